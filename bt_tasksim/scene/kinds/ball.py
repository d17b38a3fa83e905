"""Balls."""

from __future__ import annotations

import math

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import register
from bt_tasksim.scene import meshes
from bt_tasksim.scene.geometry import BallPiece, Shape, ShapeSize
from bt_tasksim.scene.grip_places import superelliptic_grips
from bt_tasksim.scene.grips import Grips
from bt_tasksim.scene.meshes import MassProperties
from bt_tasksim.scene.shape_kind import GraspAxis, ShapeKind, level_grasp_axes
from bt_tasksim.scene.surfaces import SuperellipsoidSurface

STEEPEST = math.atan(0.4)
"""Radians by which the surface may slope against a finger; see `bt_tasksim.scene.antipodal.FRICTION`."""
UNEVEN = 1e-6
"""Metres by which the sizes of a ball may differ."""


@register("shape", "ball")
class BallKind(ShapeKind):
    """A ball, truly round: it rolls. As drawn it is what one pours, or a table tennis ball."""

    size_range = ((0.036, 0.036, 0.036), (0.044, 0.044, 0.044))
    cubic = True
    symmetry = 0

    def check(self, size: ShapeSize) -> None:
        """See `ShapeKind.check`."""
        super().check(size)
        if max(size.size) - min(size.size) > UNEVEN:
            raise InputError(f"a ball is as wide as it is long and high, found {size.size}")

    def shape(self, size: ShapeSize) -> Shape:
        """See `ShapeKind.shape`."""
        radius = size.size[0] / 2
        half = np.full(3, radius)
        return Shape(
            extent=size.size,
            collision=(BallPiece(np.zeros(3), radius),),
            draw=lambda: meshes.superellipsoid(half, 1.0, 1.0),
            weigh=lambda: _mass(radius),
            surface=SuperellipsoidSurface((radius, radius, radius), (1.0, 1.0)),
        )

    def grasp_axes(self, size: ShapeSize) -> tuple[GraspAxis, ...]:
        """See `ShapeKind.grasp_axes`."""
        return level_grasp_axes(size, upright=True)

    def grips(self, size: ShapeSize) -> Grips:
        """See `ShapeKind.grips`."""
        radius = size.size[0] / 2
        return superelliptic_grips((radius, radius, radius), (1.0, 1.0), STEEPEST)


def _mass(radius: float) -> MassProperties:
    """Of a full ball."""
    return MassProperties(4.0 / 3.0 * math.pi * radius**3, poses.pose([0, 0, 0]), np.full(3, 0.4 * radius**2))
