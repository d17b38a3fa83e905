"""Prisms on a rhombus."""

from __future__ import annotations

import math

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.scene.geometry import Shape, ShapeSize, Size, polygon, prism_shape, upright_piece
from bt_tasksim.scene.grip_places import across, heights, not_too_wide
from bt_tasksim.scene.grips import Grips
from bt_tasksim.scene.shape_kind import GraspAxis, ShapeKind
from bt_tasksim.scene.symmetry import order_of_quarters


@register("shape", "diamond")
class DiamondKind(ShapeKind):
    """An upright prism on a rhombus; its size is long diagonal, short diagonal, height."""

    size_range = ((0.066, 0.050, 0.07), (0.090, 0.070, 0.12))

    def shape(self, size: ShapeSize) -> Shape:
        """See `ShapeKind.shape`."""
        half = size.size[2] / 2
        outline = rhombus(*size.size[:2])
        piece = upright_piece(outline, -half, half)
        return prism_shape(self.extent(size), outline, outline, polygon(outline), (piece,))

    def extent(self, size: ShapeSize) -> Size:
        """See `ShapeKind.extent`."""
        outline = rhombus(*size.size[:2])
        spread = np.max(outline, axis=0) - np.min(outline, axis=0)
        return float(spread[0]), float(spread[1]), size.size[2]

    def symmetry_of(self, size: ShapeSize) -> int:
        """A quarter turn where it is as wide as it is long."""
        return order_of_quarters(size.size)

    def grasp_axes(self, size: ShapeSize) -> tuple[GraspAxis, ...]:
        """See `ShapeKind.grasp_axes`: across either pair of opposite faces."""
        x, y, _ = size.size
        width, turn = diamond_width(x, y), 2 * math.atan2(y, x)
        return ((0.0, 1.0, 0.0), width), ((-math.sin(turn), math.cos(turn), 0.0), width)

    def grips(self, size: ShapeSize) -> Grips:
        """See `ShapeKind.grips`: across its pairs of faces, and from below to above."""
        z = size.size[2]
        faces = [
            across(axis, width, [(0, 0, h) for h in heights(z)]) for axis, width in self.grasp_axes(size)
        ]
        return not_too_wide([*faces, across((0, 0, 1), z, [(0, 0, 0)])])


def diamond_width(long: float, short: float) -> float:
    """Metres between opposite faces of a rhombic prism with these diagonals in metres."""
    return long * short / math.hypot(long, short)


def rhombus(long: float, short: float) -> Array:
    """Corners ``(4, 2)`` of a rhombus, turned so that y is normal to one pair of its sides."""
    corners = np.array([[long / 2, 0], [0, short / 2], [-long / 2, 0], [0, -short / 2]])
    angle = math.atan2(short, long)
    c, s = math.cos(angle), math.sin(angle)
    return corners @ np.array([[c, s], [-s, c]])
