"""Superellipsoids: everything between a box, a cylinder and an ellipsoid."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.scene import meshes
from bt_tasksim.scene.antipodal import FRICTION
from bt_tasksim.scene.geometry import ConvexPiece, Shape, ShapeSize
from bt_tasksim.scene.grip_places import superelliptic_grips
from bt_tasksim.scene.grips import Grips
from bt_tasksim.scene.shape_kind import GraspAxis, ShapeKind, level_grasp_axes
from bt_tasksim.scene.surfaces import SuperellipsoidSurface
from bt_tasksim.scene.symmetry import order_of_quarters, symmetry_tolerance

SHARPEST = 0.05
"""An exponent below this is a box to within 0.2 mm, and its powers would overflow."""


@register("shape", "superellipsoid")
class SuperellipsoidKind(ShapeKind):
    """A superellipsoid with two exponents, see `meshes.superellipsoid_scale`."""

    size_range = ((0.060, 0.036, 0.05), (0.090, 0.056, 0.08))

    def check(self, size: ShapeSize) -> None:
        """See `ShapeKind.check`."""
        super().check(size)
        if not all(0 < e <= 2 for e in size.exponents):
            raise InputError(
                f"a superellipsoid's exponents should be above 0 and at most 2, where it is convex, "
                f"found {size.exponents}"
            )

    def shape(self, size: ShapeSize) -> Shape:
        """See `ShapeKind.shape`."""
        half = np.array(size.size) / 2
        e1, e2 = (max(e, SHARPEST) for e in size.exponents)
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

    def symmetry_of(self, size: ShapeSize) -> int:
        """A quarter turn where it is as wide as it is long; any turn where its outline is a circle then."""
        order = order_of_quarters(size.size)
        # How far the outline |x|^(2/e) + |y|^(2/e) = 1 is from a circle on its diagonal.
        off = abs(2.0 ** ((1.0 - size.exponents[1]) / 2.0) - 1.0) * size.size[0] / 2.0
        return 0 if order == 4 and off <= symmetry_tolerance(size.size) else order

    def grasp_axes(self, size: ShapeSize) -> tuple[GraspAxis, ...]:
        """See `ShapeKind.grasp_axes`."""
        return level_grasp_axes(size)

    def grips(self, size: ShapeSize) -> Grips:
        """See `ShapeKind.grips`, where its surface is not too steep."""
        half = (size.size[0] / 2, size.size[1] / 2, size.size[2] / 2)
        exponents = (max(size.exponents[0], SHARPEST), max(size.exponents[1], SHARPEST))
        return superelliptic_grips(half, exponents, math.atan(FRICTION))


@lru_cache(maxsize=1)
def _hull_directions() -> Array:
    return np.concatenate([meshes.cube_sphere(3).vertices, np.eye(3), -np.eye(3)])
