"""Kinds of objects and their geometry: what collides, what is seen, how heavy, where to grasp.

Every object's frame has its origin in the middle of its bounding box, z up when it stands, and y along the
best direction for two fingers to close. Sizes are full sizes in metres.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from bt_tasksim import meshes, poses
from bt_tasksim.errors import InputError, nearest
from bt_tasksim.files import file_version
from bt_tasksim.meshes import MassProperties, TriangleMesh
from bt_tasksim.poses import Array
from bt_tasksim.surfaces import Ellipse, Polygon, PrismSurface, SuperellipsoidSurface, Surface
from bt_tasksim.world import ObjectModel, PlaceModel

Size = tuple[float, float, float]
Colour = tuple[float, float, float]

CUP_WALL = 0.004
CUP_BASE = 0.005
WIDEST_GRASP = 0.07
"""Metres: a further closing axis is named only where the object is no wider."""

_CUP_SIDES = 16
_ROUND_SIDES = 24
_SHARPEST = 0.05

_BRIGHT: tuple[Colour, ...] = (
    (0.86, 0.16, 0.15),
    (0.95, 0.56, 0.12),
    (0.93, 0.76, 0.15),
    (0.22, 0.60, 0.32),
    (0.13, 0.46, 0.72),
    (0.45, 0.29, 0.64),
)


@dataclass(frozen=True)
class Kind:
    """A category of objects.

    Attributes:
        size_range: Low and high full sizes ``((3,), (3,))`` in metres, from which sizes are drawn.
        round: Its size along x equals that along y.
        cubic_range: All its sizes are drawn equal.
        colours: RGB colours (sRGB, 0 to 1) it may have.
        area_on: Half sizes ``(2,)`` in metres of the area about a place's origin in which it is drawn.
    """

    size_range: tuple[Size, Size]
    round: bool = False
    cubic_range: bool = False
    colours: tuple[Colour, ...] = _BRIGHT
    area_on: Callable[[PlaceModel], tuple[float, float]] = lambda place: area_on(place)


def area_on(place: PlaceModel) -> tuple[float, float]:
    """Half sizes ``(2,)`` in metres of the area about a place's origin that an arm reaches well."""
    match place.kind:
        case "board":
            return 0.01, 0.12
        case "table":
            return 0.08, 0.10
        case _:
            return min(0.02, place.extent[0] / 8), min(0.02, place.extent[1] / 8)


KINDS: dict[str, Kind] = {
    "box": Kind(((0.056, 0.036, 0.07), (0.080, 0.056, 0.12))),
    "cube": Kind(((0.044, 0.044, 0.044), (0.054, 0.054, 0.054)), cubic_range=True),
    "cup": Kind(((0.064, 0.064, 0.09), (0.072, 0.072, 0.11)), round=True),
    "cylinder": Kind(((0.044, 0.044, 0.07), (0.062, 0.062, 0.12)), round=True),
    "oval": Kind(((0.060, 0.038, 0.07), (0.085, 0.056, 0.12))),
    "diamond": Kind(((0.066, 0.050, 0.07), (0.090, 0.070, 0.12))),
    "superellipsoid": Kind(((0.060, 0.036, 0.05), (0.090, 0.056, 0.08))),
    "mesh": Kind(((0.05, 0.05, 0.05), (0.05, 0.05, 0.05))),
}
"""What objects there are. Size is that of the bounding box, but for ``diamond``: long diagonal, short
diagonal, height. A ``mesh`` has the size of its file unless another one is given."""


@dataclass(frozen=True)
class ShapeSize:
    """What a kind needs to become a shape: full size (m), exponents of a superellipsoid, file of a mesh."""

    size: Size
    exponents: tuple[float, float] = (1.0, 1.0)
    mesh: str | None = None


@dataclass(frozen=True, eq=False)
class BoxPiece:
    """A box: pose ``(7,)`` in the object's frame, half size ``(3,)`` in metres."""

    pose: Array
    half_size: Array

    def corners(self) -> Array:
        """Its corners ``(8, 3)`` in the object's frame, metres."""
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
        return poses.transform(self.pose, signs * self.half_size)


@dataclass(frozen=True, eq=False)
class ConvexPiece:
    """The convex hull of ``vertices (n, 3)`` in the object's frame, metres; at most 64 of them."""

    vertices: Array

    def corners(self) -> Array:
        """Its corners ``(n, 3)`` in the object's frame, metres."""
        return self.vertices


Piece = BoxPiece | ConvexPiece


@dataclass(frozen=True, eq=False)
class Shape:
    """The geometry of an object in its own frame.

    Attributes:
        extent: Full size ``(3,)`` of the bounding box, metres.
        collision: Convex pieces that together are the solid.
        draw: Makes the mesh that is seen; physics alone never does.
        weigh: Computes `mass`; nobody asks for that of a shape which is only taken to be there.
        surface: Outer surface without hollows.
    """

    extent: Size
    collision: tuple[Piece, ...]
    draw: Callable[[], TriangleMesh]
    weigh: Callable[[], MassProperties]
    surface: Surface

    @cached_property
    def visual(self) -> TriangleMesh:
        """What is seen; a cup really is hollow."""
        return self.draw()

    @cached_property
    def mass(self) -> MassProperties:
        """Volume, centre of mass and inertia for 1 kg."""
        return self.weigh()

    @property
    def volume(self) -> float:
        """Volume of the material, m^3."""
        return self.mass.volume


def nearest_point(shape: Shape, point: Array) -> Array:
    """The nearest points ``(..., 3)`` on the outer surface to points ``(..., 3)``, in the object's frame.

    Exact for boxes, cylinders and diamonds; the line to the middle is followed for ovals and
    superellipsoids, a mesh counts as its bounding box, and a cup as if it were full.
    """
    return shape.surface.nearest(point)


def shape(kind: str, size: ShapeSize) -> Shape:
    """The geometry of an object; the same arguments give the same object, which nobody may change.

    A mesh whose file has changed is another object.

    Raises:
        InputError: Unknown kind, a size that is not positive, exponents out of range, or a bad mesh.
    """
    return _shape(kind, size, () if size.mesh is None else file_version(size.mesh))


@lru_cache(maxsize=4096)
def _shape(kind: str, size: ShapeSize, version: tuple[int, ...]) -> Shape:
    _check(kind, size)
    x, y, z = size.size
    half = np.array([x, y, z]) / 2
    match kind:
        case "box" | "cube":
            piece = BoxPiece(poses.pose([0, 0, 0]), half)
            outline = meshes.rounded_rectangle(half[0], half[1], min(0.003, 0.2 * min(x, y)))
            corners = ((half[0], half[1]), (-half[0], half[1]), (-half[0], -half[1]), (half[0], -half[1]))
            return _prism(size.size, np.array(corners), outline, Polygon(_floats(corners)), (piece,))
        case "cylinder" | "oval":
            outline = meshes.circle() * half[:2]
            hull = meshes.circumscribed_circle(_ROUND_SIDES) * half[:2]
            return _prism(
                size.size, outline, outline, Ellipse(x / 2, y / 2), (_upright(hull, -half[2], half[2]),)
            )
        case "diamond":
            outline = _diamond(x, y)
            spread = np.max(outline, axis=0) - np.min(outline, axis=0)
            piece_d = _upright(outline, -half[2], half[2])
            return _prism(
                (float(spread[0]), float(spread[1]), z),
                outline,
                outline,
                Polygon(_floats(outline)),
                (piece_d,),
            )
        case "cup":
            return _cup(size.size)
        case "superellipsoid":
            return _superellipsoid(size)
        case _:
            from bt_tasksim.mesh_file import mesh_shape

            assert size.mesh is not None
            return mesh_shape(size.mesh, size.size)


def size_range(kind: str, mesh: str | None = None) -> tuple[Size, Size]:
    """Low and high full sizes ``((3,), (3,))`` in metres that a kind has where none are given.

    Raises:
        InputError: The kind is a mesh, and its file cannot be read.
    """
    if kind == "mesh":
        if mesh is None:
            raise InputError("an object of kind 'mesh' needs the path of a mesh file")
        from bt_tasksim.mesh_file import mesh_extent

        return mesh_extent(mesh), mesh_extent(mesh)
    return KINDS[kind].size_range


def object_model(name: str, kind: str, size: ShapeSize) -> ObjectModel:
    """What is known beforehand about an object of this kind and size, see `ObjectModel`.

    Raises:
        InputError: Unknown kind, a size that is not positive, or exponents out of range.
    """
    _check(kind, size)
    x, y, z = size.size
    extent, symmetry, axes, widths = size.size, 2, [(0.0, 1.0, 0.0)], [y]
    match kind:
        case "box" | "cube" | "superellipsoid" | "mesh":
            symmetry = 1 if kind == "mesh" else 4 if kind == "cube" else 2
            candidates = [((0.0, 1.0, 0.0), y), ((1.0, 0.0, 0.0), x)]
            if kind == "cube":
                candidates.append(((0.0, 0.0, 1.0), z))
            candidates.sort(key=lambda c: c[1])
            kept = [c for c in candidates if c[1] <= WIDEST_GRASP] or candidates[:1]
            axes, widths = [c[0] for c in kept], [c[1] for c in kept]
        case "diamond":
            outline = _diamond(x, y)
            spread = np.max(outline, axis=0) - np.min(outline, axis=0)
            extent = (float(spread[0]), float(spread[1]), z)
            width, turn = diamond_width(x, y), 2 * math.atan2(y, x)
            axes, widths = [(0.0, 1.0, 0.0), (-math.sin(turn), math.cos(turn), 0.0)], [width, width]
        case "cup" | "cylinder":
            symmetry = 0
        case _:
            pass
    return ObjectModel(name, kind, extent, symmetry, tuple(axes), tuple(widths), cubic=kind == "cube")


def resting_height(kind: str, size: ShapeSize) -> float:
    """Metres from the surface an object stands on up to its origin."""
    return size.size[2] / 2


def diamond_width(long: float, short: float) -> float:
    """Metres between opposite faces of a rhombic prism with these diagonals in metres."""
    return long * short / math.hypot(long, short)


def _check(kind: str, size: ShapeSize) -> None:
    if kind not in KINDS:
        raise InputError(f"unknown kind of object '{kind}'{nearest(kind, KINDS)}")
    if len(size.size) != 3 or not all(math.isfinite(v) and v > 0 for v in size.size):
        raise InputError(f"a {kind}'s size should be three positive numbers in metres, found {size.size}")
    if kind == "superellipsoid" and not all(0 < e <= 2 for e in size.exponents):
        raise InputError(
            f"a superellipsoid's exponents should be above 0 and at most 2, where it is convex, "
            f"found {size.exponents}"
        )
    if kind == "mesh" and size.mesh is None:
        raise InputError("an object of kind 'mesh' needs the path of a mesh file")
    if kind == "cup" and min(size.size[:2]) <= 2 * CUP_WALL + 0.01:
        raise InputError(f"a cup of {1000 * min(size.size[:2]):.0f} mm across has no room inside its walls")


def _diamond(long: float, short: float) -> Array:
    """Corners ``(4, 2)`` of a rhombus, turned so that y is normal to one pair of its sides."""
    corners = np.array([[long / 2, 0], [0, short / 2], [-long / 2, 0], [0, -short / 2]])
    angle = math.atan2(short, long)
    c, s = math.cos(angle), math.sin(angle)
    return corners @ np.array([[c, s], [-s, c]])


def _upright(outline: Array, low: float, high: float) -> ConvexPiece:
    n = len(outline)
    vertices = np.concatenate(
        [np.column_stack([outline, np.full(n, low)]), np.column_stack([outline, np.full(n, high)])]
    )
    vertices.setflags(write=False)
    return ConvexPiece(vertices)


def _prism(
    extent: Size, solid: Array, seen: Array, footprint: Ellipse | Polygon, collision: tuple[Piece, ...]
) -> Shape:
    height = extent[2]
    return Shape(
        extent=extent,
        collision=collision,
        draw=lambda: meshes.prism(seen, height, bevel=min(0.0015, 0.1 * min(extent))),
        weigh=lambda: meshes.mass_properties(meshes.prism(solid, height)),
        surface=PrismSurface(footprint, height / 2),
    )


def _cup(size: Size) -> Shape:
    radius, height = min(size[:2]) / 2, size[2]
    h, base = height / 2, min(CUP_BASE, size[2] / 4)
    # Boxes whose outer faces lie on the outer surface: flat where fingers close, and no hulls to compute.
    side = 2 * radius * math.tan(math.pi / _CUP_SIDES)
    pieces: list[Piece] = [_upright(meshes.circumscribed_circle(_CUP_SIDES) * radius, -h, -h + base)]
    for i in range(_CUP_SIDES):
        angle = 2 * math.pi * i / _CUP_SIDES
        middle = radius - CUP_WALL / 2
        position = [middle * math.cos(angle), middle * math.sin(angle), base / 2]
        half_size = np.array([CUP_WALL / 2, side / 2, (height - base) / 2])
        pieces.append(BoxPiece(poses.pose(position, poses.yaw(angle)), half_size))
    visual = meshes.cup(radius, height, CUP_WALL, base)
    return Shape(
        extent=(2 * radius, 2 * radius, height),
        collision=tuple(pieces),
        draw=lambda: visual,
        weigh=lambda: meshes.mass_properties(visual),
        surface=PrismSurface(Ellipse(radius, radius), h),
    )


def _superellipsoid(size: ShapeSize) -> Shape:
    half = np.array(size.size) / 2
    # Sharper than this is a box to within 0.2 mm, and its powers would overflow.
    e1, e2 = (max(e, _SHARPEST) for e in size.exponents)
    coarse = _hull_directions()
    hull = coarse * meshes.superellipsoid_scale(coarse, e1, e2)[:, None] * half
    hull.setflags(write=False)
    return Shape(
        extent=size.size,
        collision=(ConvexPiece(hull),),
        draw=lambda: meshes.superellipsoid(half, e1, e2),
        weigh=lambda: meshes.mass_properties(meshes.superellipsoid(half, e1, e2)),
        surface=SuperellipsoidSurface((float(half[0]), float(half[1]), float(half[2])), (e1, e2)),
    )


@lru_cache(maxsize=1)
def _hull_directions() -> Array:
    return np.concatenate([meshes.cube_sphere(3).vertices, np.eye(3), -np.eye(3)])


def _floats(corners: Array) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in corners)
