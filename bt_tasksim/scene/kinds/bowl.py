"""Bowls."""

from __future__ import annotations

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.scene import meshes
from bt_tasksim.scene.geometry import Shape, ShapeSize
from bt_tasksim.scene.grips import Grips, firm_about
from bt_tasksim.scene.hollows import columns
from bt_tasksim.scene.kinds.cup import BASE, RIM, RIM_FIRM, WALL
from bt_tasksim.scene.shape_kind import GraspAxis, ShapeKind
from bt_tasksim.scene.surfaces import Ellipse, PrismSurface
from bt_tasksim.scene.vessels import SIDES, floor_piece, wall_piece

NARROWER = 0.62
"""Share of its width that a bowl has at its bottom."""
NARROWEST = 0.05
"""Metres."""


@register("shape", "bowl")
class BowlKind(ShapeKind):
    """A round bowl, open at the top and really hollow, whose straight wall leans outwards."""

    size_range = ((0.13, 0.13, 0.05), (0.15, 0.15, 0.06))
    round = True
    symmetry = 0

    def check(self, size: ShapeSize) -> None:
        """See `ShapeKind.check`."""
        super().check(size)
        if min(size.size[:2]) < NARROWEST:
            raise InputError(
                f"a bowl of {1000 * min(size.size[:2]):.0f} mm across has no room inside its walls: "
                f"give it {1000 * NARROWEST:.0f} mm at least"
            )

    def shape(self, size: ShapeSize) -> Shape:
        """See `ShapeKind.shape`."""
        radius, height = min(size.size[:2]) / 2, size.size[2]
        h, base = height / 2, min(BASE, height / 4)
        ends = ((-h, NARROWER * radius), (h, radius))
        pieces = [floor_piece(NARROWER * radius - WALL / 2, -h, base - h)]
        pieces += [wall_piece(side, ends, WALL) for side in range(SIDES)]
        corners = tuple(piece.corners() for piece in pieces)
        visual = _drawn(radius, height, base)
        return Shape(
            extent=(2 * radius, 2 * radius, height),
            collision=tuple(pieces),
            draw=lambda: visual,
            weigh=lambda: meshes.mass_properties(meshes.hulls(corners)),
            surface=PrismSurface(Ellipse(radius, radius), h),
            hollowed=lambda: _hollow(radius, height, base),
        )

    def grasp_axes(self, size: ShapeSize) -> tuple[GraspAxis, ...]:
        """See `ShapeKind.grasp_axes`: as wide as it is, so no hand closes about it."""
        return (((0.0, 1.0, 0.0), min(size.size[:2])),)

    def grips(self, size: ShapeSize) -> Grips:
        """See `ShapeKind.grips`: with one finger in it, from above."""
        radius, height = min(size.size[:2]) / 2, size.size[2]
        angle = 2 * np.pi * np.arange(SIDES) / SIDES
        way = np.stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)], axis=-1)
        below = min(RIM, height / 4)
        middle = radius - WALL / 2 - (1.0 - NARROWER) * radius * below / height
        rim = middle * way + [0.0, 0.0, height / 2 - below]
        down = [[0.0, 0.0, -1.0]] * SIDES
        return Grips.of(rim, way, [WALL] * SIDES, down, RIM_FIRM * firm_about(rim, np.zeros(3)))


def _hollow(radius: float, height: float, base: float) -> Array:
    """Where a bowl is hollow, as `bt_tasksim.scene.hollows.hollow` finds it, at once."""
    cells = columns((2 * radius, 2 * radius, height))
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    away = np.max(cells[:, :2] @ np.array([np.cos(angle), np.sin(angle)]), axis=1) + WALL
    up = (away - NARROWER * radius) / ((1.0 - NARROWER) * radius)
    floor = np.maximum(up * height, base) - height / 2
    boxes = np.column_stack([cells, floor, np.full(len(cells), height / 2)])
    found: Array = boxes[away < radius]
    return found


def _drawn(radius: float, height: float, base: float) -> meshes.TriangleMesh:
    """What is seen of a bowl."""
    h, low = height / 2, NARROWER * radius
    inner = low + (radius - low) * base / height - WALL
    profile = [
        [0, -h], [low, -h], [radius, h], [radius - WALL, h], [inner, base - h], [0, base - h],
    ]  # fmt: skip
    return meshes.loft(meshes.circle(), np.array(profile))
