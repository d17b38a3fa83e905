"""Cups."""

from __future__ import annotations

import math

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.scene import meshes
from bt_tasksim.scene.geometry import BoxPiece, Piece, Shape, ShapeSize, Size, upright_piece
from bt_tasksim.scene.grip_places import AROUND, elliptic_grips
from bt_tasksim.scene.grips import Grips, firm_about
from bt_tasksim.scene.hollows import columns
from bt_tasksim.scene.shape_kind import ShapeKind
from bt_tasksim.scene.surfaces import Ellipse, PrismSurface

WALL = 0.004
"""Metres."""
BASE = 0.005
"""Metres, and at most a quarter of the height."""
SIDES = 16
"""Flat sides of what collides."""
RIM = 0.012
"""Metres below the rim where a finger inside and one outside hold, at most a quarter of the height."""
RIM_FIRM = 0.3
HOLLOW_FIRM = 0.9
"""Firmness: a thin wall is held along a line, and a hollow thing gives way."""


@register("shape", "cup")
class CupKind(ShapeKind):
    """A round cup without a handle, open at the top and really hollow."""

    size_range = ((0.064, 0.064, 0.09), (0.072, 0.072, 0.11))
    round = True
    symmetry = 0

    def check(self, size: ShapeSize) -> None:
        """See `ShapeKind.check`."""
        super().check(size)
        across = min(size.size[:2])
        if across <= 2 * WALL + 0.01:
            raise InputError(f"a cup of {1000 * across:.0f} mm across has no room inside its walls")

    def shape(self, size: ShapeSize) -> Shape:
        """See `ShapeKind.shape`."""
        radius, height = min(size.size[:2]) / 2, size.size[2]
        h, base = height / 2, min(BASE, height / 4)
        # Boxes whose outer faces lie on the outer surface: flat where fingers close, no hulls to compute.
        side = 2 * radius * math.tan(math.pi / SIDES)
        pieces: list[Piece] = [upright_piece(meshes.circumscribed_circle(SIDES) * radius, -h, -h + base)]
        for i in range(SIDES):
            angle = 2 * math.pi * i / SIDES
            middle = radius - WALL / 2
            position = [middle * math.cos(angle), middle * math.sin(angle), base / 2]
            half_size = np.array([WALL / 2, side / 2, (height - base) / 2])
            pieces.append(BoxPiece(poses.pose(position, poses.yaw(angle)), half_size))
        visual = meshes.cup(radius, height, WALL, base)
        return Shape(
            extent=(2 * radius, 2 * radius, height),
            collision=tuple(pieces),
            draw=lambda: visual,
            weigh=lambda: meshes.mass_properties(visual),
            surface=PrismSurface(Ellipse(radius, radius), h),
            hollowed=lambda: _hollow(radius - WALL, (2 * radius, 2 * radius, height), base - h),
        )

    def grips(self, size: ShapeSize) -> Grips:
        """See `ShapeKind.grips`: about it, or with one finger in it, from above."""
        across, height = min(size.size[:2]), size.size[2]
        angle = 2 * np.pi * np.arange(AROUND) / AROUND
        way = np.stack([np.cos(angle), np.sin(angle), np.zeros(AROUND)], axis=-1)
        rim = (across - WALL) / 2 * way + [0.0, 0.0, height / 2 - min(RIM, height / 4)]
        down = [[0.0, 0.0, -1.0]] * AROUND
        firm = RIM_FIRM * firm_about(rim, np.zeros(3))
        by_the_rim = Grips.of(rim, way, [WALL] * AROUND, down, firm)
        around = elliptic_grips((across, across, height), HOLLOW_FIRM, lids=False)
        return Grips.joined([around, by_the_rim])


def _hollow(radius: float, extent: Size, floor: float) -> Array:
    """Where a cup is hollow, as `bt_tasksim.scene.hollows.hollow` finds it, at once.

    Args:
        radius: From its axis to its walls, metres.
        extent: Full size ``(3,)``.
        floor: Height of its floor.
    """
    cells = columns(extent)
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    away = np.max(cells[:, :2] @ np.array([np.cos(angle), np.sin(angle)]), axis=1)
    height = np.broadcast_to([floor, extent[2] / 2], (len(cells), 2))
    found: Array = np.concatenate([cells, height], axis=1)[away < radius]
    return found
