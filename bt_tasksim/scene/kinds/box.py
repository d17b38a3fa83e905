"""Boxes."""

from __future__ import annotations

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.registry import register
from bt_tasksim.scene import meshes
from bt_tasksim.scene.geometry import BoxPiece, Shape, ShapeSize, polygon, prism_shape
from bt_tasksim.scene.grip_places import box_grips
from bt_tasksim.scene.grips import Grips
from bt_tasksim.scene.shape_kind import GraspAxis, ShapeKind, level_grasp_axes
from bt_tasksim.scene.symmetry import order_of_quarters


@register("shape", "box")
class BoxKind(ShapeKind):
    """A box, its upright edges rounded to the eye."""

    size_range = ((0.056, 0.036, 0.07), (0.080, 0.056, 0.12))

    def shape(self, size: ShapeSize) -> Shape:
        """See `ShapeKind.shape`."""
        return box_shape(size)

    def symmetry_of(self, size: ShapeSize) -> int:
        """A quarter turn where it is as wide as it is long."""
        return order_of_quarters(size.size)

    def grasp_axes(self, size: ShapeSize) -> tuple[GraspAxis, ...]:
        """See `ShapeKind.grasp_axes`."""
        return level_grasp_axes(size)

    def grips(self, size: ShapeSize) -> Grips:
        """See `ShapeKind.grips`."""
        return box_grips(size.size)


def box_shape(size: ShapeSize) -> Shape:
    """The geometry of a box."""
    x, y, _ = size.size
    half = np.array(size.size) / 2
    outline = meshes.rounded_rectangle(half[0], half[1], min(0.003, 0.2 * min(x, y)))
    corners = np.array([[half[0], half[1]], [-half[0], half[1]], [-half[0], -half[1]], [half[0], -half[1]]])
    piece = BoxPiece(poses.pose([0, 0, 0]), half)
    return prism_shape(size.size, corners, outline, polygon(corners), (piece,))
