"""Cubes."""

from __future__ import annotations

from bt_tasksim.core.registry import register
from bt_tasksim.scene.geometry import Shape, ShapeSize
from bt_tasksim.scene.grip_places import box_grips
from bt_tasksim.scene.grips import Grips
from bt_tasksim.scene.kinds.box import box_shape
from bt_tasksim.scene.shape_kind import GraspAxis, ShapeKind, level_grasp_axes


@register("shape", "cube")
class CubeKind(ShapeKind):
    """A box of equal sides, which may lie on any of its faces."""

    size_range = ((0.044, 0.044, 0.044), (0.054, 0.054, 0.054))
    cubic = True
    symmetry = 4

    def shape(self, size: ShapeSize) -> Shape:
        """See `ShapeKind.shape`."""
        return box_shape(size)

    def grasp_axes(self, size: ShapeSize) -> tuple[GraspAxis, ...]:
        """See `ShapeKind.grasp_axes`."""
        return level_grasp_axes(size, upright=True)

    def grips(self, size: ShapeSize) -> Grips:
        """See `ShapeKind.grips`."""
        return box_grips(size.size)
