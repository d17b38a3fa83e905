"""Geometry of objects: convex pieces that collide, a mesh that is seen, mass, and the outer surface.

An object's frame has its origin in the middle of its bounding box, z up when it stands, and y along the best
direction for two fingers to close. Sizes are full sizes in metres.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.scene import meshes
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.hollows import hollow, outer_corners
from bt_tasksim.scene.meshes import MassProperties, TriangleMesh
from bt_tasksim.scene.surfaces import Ellipse, OuterSurface, Polygon, PrismSurface

Size = tuple[float, float, float]
Colour = tuple[float, float, float]


@dataclass(frozen=True)
class ShapeSize:
    """What a kind needs to become a shape.

    Full size (m), exponents of a superellipsoid, file of a mesh, boxes of a part of a fixture.
    """

    size: Size
    exponents: tuple[float, float] = (1.0, 1.0)
    mesh: str | None = None
    boxes: tuple[Box, ...] = ()


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


@dataclass(frozen=True, eq=False)
class BallPiece:
    """A ball: its middle ``(3,)`` in the object's frame and its radius, metres. Physics has it round."""

    middle: Array
    radius: float

    def corners(self) -> Array:
        """Points ``(n, 3)`` all over it, in the object's frame, metres, those on its axes among them."""
        return self.middle + self.radius * meshes.on_unit_ball()


Piece = BoxPiece | ConvexPiece | BallPiece


@dataclass(frozen=True, eq=False)
class Shape:
    """The geometry of an object in its own frame.

    Attributes:
        extent: Full size ``(3,)`` of the bounding box, metres.
        collision: Convex pieces that together are the solid.
        draw: Makes the mesh that is seen; physics alone never does.
        weigh: Computes `mass`; nobody asks for that of a shape which is only taken to be there.
        surface: Outer surface without hollows.
        hollowed: Says where it is hollow, see `hollow`; by default that is computed from its pieces.
    """

    extent: Size
    collision: tuple[Piece, ...]
    draw: Callable[[], TriangleMesh]
    weigh: Callable[[], MassProperties]
    surface: OuterSurface
    hollowed: Callable[[], Array] | None = None

    @cached_property
    def visual(self) -> TriangleMesh:
        """What is seen; a cup really is hollow."""
        return self.draw()

    @cached_property
    def mass(self) -> MassProperties:
        """Volume, centre of mass and inertia for 1 kg."""
        return self.weigh()

    @cached_property
    def pieces(self) -> tuple[Array, ...]:
        """Corners ``(n, 3)`` of each of its convex pieces, metres."""
        return tuple(piece.corners() for piece in self.collision)

    @cached_property
    def outer(self) -> Array:
        """Corners ``(n, 3)`` of the convex hull of all pieces, metres."""
        return outer_corners(self.pieces)

    @cached_property
    def hollow(self) -> Array:
        """Where something may lie within it: boxes ``(k, 6)``, see `bt_tasksim.scene.hollows`."""
        return hollow(self.pieces, self.extent) if self.hollowed is None else self.hollowed()

    @property
    def volume(self) -> float:
        """Volume of the material, m^3."""
        return self.mass.volume


def prism_shape(
    extent: Size, solid: Array, seen: Array, footprint: Ellipse | Polygon, collision: tuple[Piece, ...]
) -> Shape:
    """An upright prism with a convex footprint.

    Args:
        extent: Full size of its bounding box, metres.
        solid: Corners ``(n, 2)`` of what is weighed, in order, metres.
        seen: Outline ``(m, 2)`` of what is drawn.
        footprint: Of its outer surface.
        collision: Convex pieces that together are the solid.
    """
    height = extent[2]
    return Shape(
        extent=extent,
        collision=collision,
        draw=lambda: meshes.prism(seen, height, bevel=min(0.0015, 0.1 * min(extent))),
        weigh=lambda: meshes.mass_properties(meshes.prism(solid, height)),
        surface=PrismSurface(footprint, height / 2),
    )


def upright_piece(outline: Array, low: float, high: float) -> ConvexPiece:
    """The prism over an outline ``(n, 2)`` from one height to another, metres."""
    n = len(outline)
    vertices = np.concatenate(
        [np.column_stack([outline, np.full(n, low)]), np.column_stack([outline, np.full(n, high)])]
    )
    vertices.setflags(write=False)
    return ConvexPiece(vertices)


def polygon(corners: Array) -> Polygon:
    """The footprint with these corners ``(n, 2)``, in order, metres."""
    return Polygon(tuple((float(x), float(y)) for x, y in meshes.counter_clockwise(corners)))
