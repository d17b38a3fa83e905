"""Triangle meshes of solids: made from a few numbers, and their volume and inertia.

Faces are counter-clockwise seen from outside. Everything is in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bt_tasksim.core.poses import Array, array_namespace, from_matrix, pose


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A closed surface: ``vertices (n, 3)`` in metres and ``faces (m, 3)``, indices of their corners."""

    vertices: Array
    faces: Array

    def __post_init__(self) -> None:
        self.vertices.setflags(write=False)
        self.faces.setflags(write=False)


@dataclass(frozen=True, eq=False)
class MassProperties:
    """Of a solid of even density.

    Attributes:
        volume: m^3.
        pose: Pose ``(7,)`` of the centre of mass, its axes the principal axes of inertia.
        inertia: Principal moments of inertia ``(3,)`` about that frame, for a mass of 1 kg, m^2.
    """

    volume: float
    pose: Array
    inertia: Array


def circle(segments: int = 96) -> Array:
    """Corners ``(segments, 2)`` of a regular polygon in the unit circle, counter-clockwise."""
    angle = 2 * np.pi * np.arange(segments) / segments
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def circumscribed_circle(segments: int) -> Array:
    """Corners ``(segments, 2)`` of a regular polygon around the unit circle.

    Its sides touch the circle at +-x and +-y where ``segments`` is a multiple of 4: it has the circle's
    bounding box, and flat sides where fingers close.
    """
    angle = 2 * np.pi * (np.arange(segments) + 0.5) / segments
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1) / np.cos(np.pi / segments)


def rounded_rectangle(half_x: float, half_y: float, radius: float, segments: int = 6) -> Array:
    """Outline ``(n, 2)`` of a rectangle with rounded corners, counter-clockwise, metres."""
    corners = []
    for quarter, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        angle = np.pi / 2 * (quarter + np.arange(segments + 1) / segments)
        centre = np.array([sx * (half_x - radius), sy * (half_y - radius)])
        corners.append(centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1))
    return np.concatenate(corners)


def counter_clockwise(outline: Array) -> Array:
    """The corners ``(n, 2)`` as they are, or in the other order where they were given clockwise."""
    following = np.roll(outline, -1, axis=0)
    area = float(np.sum(outline[:, 0] * following[:, 1] - outline[:, 1] * following[:, 0]))
    return outline[::-1] if area < 0.0 else outline


def loft(outline: Array, profile: Array) -> TriangleMesh:
    """The solid between scaled copies of an outline, one above the other.

    Args:
        outline: Corners ``(n, 2)`` in order around the z axis, metres (or unit lengths).
        profile: ``(m, 2)`` scale of the outline and height z of each copy, from the bottom's centre (scale 0)
            outwards to the top's centre (scale 0); may turn inwards, as a cup's does.
    """
    outline = counter_clockwise(outline)
    n, rings = len(outline), profile[1:-1]
    ring_vertices = np.concatenate(
        [np.column_stack([scale * outline, np.full(n, z)]) for scale, z in rings], axis=0
    )
    poles = np.array([[0.0, 0.0, profile[0, 1]], [0.0, 0.0, profile[-1, 1]]])
    this, following = np.arange(n), (np.arange(n) + 1) % n
    faces = []
    for k in range(len(rings) - 1):
        low, high = k * n, (k + 1) * n
        faces.append(np.column_stack([low + this, low + following, high + following]))
        faces.append(np.column_stack([low + this, high + following, high + this]))
    bottom, top, last = len(ring_vertices), len(ring_vertices) + 1, (len(rings) - 1) * n
    faces.append(np.column_stack([np.full(n, bottom), following, this]))
    faces.append(np.column_stack([np.full(n, top), last + this, last + following]))
    return TriangleMesh(np.concatenate([ring_vertices, poles]), np.concatenate(faces))


def prism(outline: Array, height: float, bevel: float = 0.0) -> TriangleMesh:
    """An upright prism centred on the origin.

    Args:
        outline: Corners ``(n, 2)`` of the convex footprint in order, metres.
        height: Metres.
        bevel: Metres by which the edges of top and bottom are broken.
    """
    h, outline = height / 2, counter_clockwise(outline)
    if bevel <= 0:
        return loft(outline, np.array([[0, -h], [1, -h], [1, h], [0, h]]))
    edges = np.roll(outline, -1, axis=0) - outline
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=-1) / np.linalg.norm(edges, axis=1, keepdims=True)
    inner = 1 - bevel / float(np.min(np.sum(normals * outline, axis=1)))
    middle = 1 - 0.3 * (1 - inner)
    b = bevel
    return loft(
        outline,
        np.array(
            [[0, -h], [inner, -h], [middle, -h + 0.3 * b], [1, -h + b],
             [1, h - b], [middle, h - 0.3 * b], [inner, h], [0, h]]
        ),
    )  # fmt: skip


def cup(radius: float, height: float, wall: float, base: float, segments: int = 96) -> TriangleMesh:
    """A hollow cup, open at the top, with a rounded rim; centred on its bounding box.

    Args:
        radius: Outer radius, metres.
        height: Metres.
        wall: Thickness of the wall, metres.
        base: Thickness of the bottom, metres.
        segments: Facets around.
    """
    h, bevel, inner = height / 2, min(0.0015, base / 3), radius - wall
    turn = np.pi * np.arange(1, 8) / 8
    rim = np.stack([radius - wall / 2 + wall / 2 * np.cos(turn), h - wall / 2 + wall / 2 * np.sin(turn)], -1)
    profile = [
        [0, -h], [radius - bevel, -h], [radius, -h + bevel], [radius, h - wall / 2],
        *rim.tolist(),
        [inner, h - wall / 2], [inner, -h + base + bevel], [inner - bevel, -h + base], [0, -h + base],
    ]  # fmt: skip
    return loft(circle(segments), np.array(profile))


@lru_cache(maxsize=1)
def on_unit_ball() -> Array:
    """Points ``(62, 3)`` all over the unit ball, those on its axes among them."""
    corners = cube_sphere(3).vertices
    corners = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    found: Array = np.concatenate([corners, np.eye(3), -np.eye(3)])
    found.setflags(write=False)
    return found


def hulls(pieces: Sequence[Array]) -> TriangleMesh:
    """The surfaces of the convex hulls of pieces, each given by its corners ``(n, 3)``, in one mesh."""
    from scipy.spatial import ConvexHull

    vertices, faces, count = [], [], 0
    for piece in pieces:
        found = ConvexHull(piece)
        corners = piece[found.simplices]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        inwards = np.sum(normals * found.equations[:, :3], axis=1) < 0.0
        turned = np.where(inwards[:, None], found.simplices[:, ::-1], found.simplices)
        vertices.append(np.asarray(piece, float))
        faces.append(turned + count)
        count += len(piece)
    return TriangleMesh(np.concatenate(vertices), np.concatenate(faces))


@lru_cache(maxsize=8)
def cube_sphere(n: int) -> TriangleMesh:
    """A cube whose faces are divided ``n`` by ``n``: vertices ``(6 n^2 + 2, 3)`` of largest coordinate 1."""
    grid = np.tan(np.linspace(-1, 1, n + 1) * np.pi / 4)
    u, v = (a.ravel() for a in np.meshgrid(grid, grid, indexing="ij"))
    one = np.ones_like(u)
    sides = [
        np.stack(columns, axis=-1)
        for columns in ((one, u, v), (-one, v, u), (v, one, u), (u, -one, v), (u, v, one), (v, u, -one))
    ]
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    a, b, c, d = i * (n + 1) + j, (i + 1) * (n + 1) + j, (i + 1) * (n + 1) + j + 1, i * (n + 1) + j + 1
    quads = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    faces = np.concatenate([quads + k * (n + 1) ** 2 for k in range(6)])
    vertices = np.concatenate(sides)
    _, first, index = np.unique(np.round(vertices, 9), axis=0, return_index=True, return_inverse=True)
    return TriangleMesh(vertices[first], index.reshape(-1)[faces])


def superellipsoid_scale(direction: Array, e1: float | Array, e2: float | Array) -> Array:
    """Factor ``(...)`` that brings directions ``(..., 3)`` onto the superellipsoid of unit half sizes.

    ((|x|^(2/e2) + |y|^(2/e2))^(e2/e1) + |z|^(2/e1)) = 1; Barr, "Superquadrics and angle-preserving
    transformations", IEEE CG&A 1981.
    """
    x, y, z = (abs(direction[..., i]) for i in range(3))
    xp = array_namespace(direction)
    level = xp.maximum(xp.maximum(x, y), z)
    level = xp.where(level > 0, level, xp.ones_like(level))
    x, y, z = x / level, y / level, z / level
    gauge = ((x ** (2 / e2) + y ** (2 / e2)) ** (e2 / e1) + z ** (2 / e1)) ** (e1 / 2)
    return 1 / (gauge * level)


def superellipsoid(half_size: Array, e1: float, e2: float, n: int = 16) -> TriangleMesh:
    """A superellipsoid of half sizes ``(3,)`` in metres, made from a cube divided ``n`` times."""
    grid = cube_sphere(n)
    scale = superellipsoid_scale(grid.vertices, e1, e2)
    return TriangleMesh(grid.vertices * scale[:, None] * half_size, grid.faces)


def volume_of(mesh: TriangleMesh) -> float:
    """Volume in m^3 of the solid inside a closed mesh; negative where its faces look inwards."""
    return float(np.sum(_determinants(mesh))) / 6


def _determinants(mesh: TriangleMesh) -> Array:
    """Six times the signed volumes ``(m,)`` of the tetrahedra between each triangle and the origin."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]].T for k in range(3))
    found: Array = (a * (b[[1, 2, 0]] * c[[2, 0, 1]] - b[[2, 0, 1]] * c[[1, 2, 0]])).sum(axis=0)
    return found


def mass_properties(mesh: TriangleMesh) -> MassProperties:
    """Volume, centre of mass and inertia of the solid inside a closed mesh, by signed tetrahedra.

    It has to enclose a volume, see `volume_of`.
    """
    corners = [mesh.vertices[mesh.faces[:, k]] for k in range(3)]
    det = _determinants(mesh)
    volume = float(np.sum(det)) / 6
    total = corners[0] + corners[1] + corners[2]
    centre = np.sum(det[:, None] * total, axis=0) / (24 * volume)
    centre = np.where(np.abs(centre) < 1e-9, 0.0, centre)
    weighed = det[:, None]
    second = sum(corner.T @ (weighed * corner) for corner in corners) + total.T @ (weighed * total)
    second = second / (120 * volume) - np.outer(centre, centre)
    tensor = np.trace(second) * np.eye(3) - second
    if np.max(np.abs(tensor - np.diag(np.diag(tensor)))) < 1e-4 * np.trace(tensor):
        return MassProperties(volume, pose(centre), np.diag(tensor).copy())
    moments, axes = np.linalg.eigh(tensor)
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    return MassProperties(volume, pose(centre, from_matrix(axes)), moments)


def shaded(mesh: TriangleMesh, crease: float = float(np.deg2rad(40.0))) -> tuple[Array, Array, Array]:
    """The mesh with normals, smooth where its faces meet at less than ``crease`` radians and sharp elsewhere.

    Returns:
        Vertices ``(3 m, 3)``, their unit normals ``(3 m, 3)``, and faces ``(m, 3)``.
    """
    corners = mesh.vertices[mesh.faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(area, axis=1, keepdims=True)
    unit = area / np.where(length > 0, length, 1.0)
    owner, face = mesh.faces.ravel(), np.repeat(np.arange(len(mesh.faces)), 3)
    order = np.argsort(owner, kind="stable")
    count = np.bincount(owner, minlength=len(mesh.vertices))
    start = np.concatenate([[0], np.cumsum(count)])
    normals = np.zeros((len(owner), 3))
    limit = np.cos(crease)
    for step in range(int(count.max())):
        known = step < count[owner]
        beside = face[order[np.minimum(start[owner] + step, len(order) - 1)]]
        near = known & (np.sum(unit[beside] * unit[face], axis=1) > limit)
        normals += np.where(near[:, None], area[beside], 0.0)
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(size > 0, normals / np.where(size > 0, size, 1.0), unit[face])
    return corners.reshape(-1, 3), normals, np.arange(len(owner)).reshape(-1, 3)
