"""Cylinders on an ellipse."""

from __future__ import annotations

from bt_tasksim.core.registry import register
from bt_tasksim.scene.geometry import Shape, ShapeSize
from bt_tasksim.scene.grip_places import elliptic_grips
from bt_tasksim.scene.grips import Grips
from bt_tasksim.scene.kinds.cylinder import elliptic_shape
from bt_tasksim.scene.shape_kind import ShapeKind
from bt_tasksim.scene.symmetry import as_wide_as_long


@register("shape", "oval")
class OvalKind(ShapeKind):
    """An upright cylinder on an ellipse."""

    size_range = ((0.060, 0.038, 0.07), (0.085, 0.056, 0.12))

    def symmetry_of(self, size: ShapeSize) -> int:
        """A body of revolution where it is as wide as it is long."""
        return 0 if as_wide_as_long(size.size) else self.symmetry

    def shape(self, size: ShapeSize) -> Shape:
        """See `ShapeKind.shape`."""
        return elliptic_shape(size)

    def grips(self, size: ShapeSize) -> Grips:
        """See `ShapeKind.grips`."""
        return elliptic_grips(size.size)
