"""Cylinders."""

from __future__ import annotations

import numpy as np

from bt_tasksim.core.registry import register
from bt_tasksim.scene import meshes
from bt_tasksim.scene.geometry import Shape, ShapeSize, prism_shape, upright_piece
from bt_tasksim.scene.grip_places import elliptic_grips
from bt_tasksim.scene.grips import Grips
from bt_tasksim.scene.shape_kind import ShapeKind
from bt_tasksim.scene.surfaces import Ellipse

SIDES = 24
"""Flat sides of what collides."""


@register("shape", "cylinder")
class CylinderKind(ShapeKind):
    """An upright cylinder."""

    size_range = ((0.044, 0.044, 0.07), (0.062, 0.062, 0.12))
    round = True
    symmetry = 0

    def shape(self, size: ShapeSize) -> Shape:
        """See `ShapeKind.shape`."""
        return elliptic_shape(size)

    def grips(self, size: ShapeSize) -> Grips:
        """See `ShapeKind.grips`."""
        return elliptic_grips(size.size)


def elliptic_shape(size: ShapeSize) -> Shape:
    """The geometry of an upright cylinder on an ellipse."""
    x, y, _ = size.size
    half = np.array(size.size) / 2
    outline = meshes.circle() * half[:2]
    hull = meshes.circumscribed_circle(SIDES) * half[:2]
    piece = upright_piece(hull, -half[2], half[2])
    return prism_shape(size.size, outline, outline, Ellipse(x / 2, y / 2), (piece,))
