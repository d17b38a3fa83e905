"""Jugs."""

from __future__ import annotations

import math

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import register
from bt_tasksim.scene import meshes
from bt_tasksim.scene.geometry import BoxPiece, Piece, Shape, ShapeSize
from bt_tasksim.scene.grip_places import elliptic_grips
from bt_tasksim.scene.grips import Grips
from bt_tasksim.scene.kinds.cup import BASE, HOLLOW_FIRM, WALL
from bt_tasksim.scene.shape_kind import GraspAxis, ShapeKind
from bt_tasksim.scene.surfaces import Ellipse, PrismSurface
from bt_tasksim.scene.vessels import SIDES, floor_piece, leaning_piece

LIP = 0.3
"""Share of its height over which the spout leans outwards."""
HANDLE = 0.008
"""Metres: thickness of the handle."""
LEAST = 0.012
"""Metres that spout and handle reach beyond the body, at least."""
NARROWEST = 0.03
"""Metres across the body."""


@register("shape", "jug")
class JugKind(ShapeKind):
    """A round jug, open at the top and really hollow, with a spout towards x and a handle opposite to it.

    Its size along y is that of its body; spout and handle share what it is longer than that. It is held about
    its body, between spout and handle.
    """

    size_range = ((0.094, 0.058, 0.095), (0.104, 0.066, 0.115))
    symmetry = 1

    def check(self, size: ShapeSize) -> None:
        """See `ShapeKind.check`."""
        super().check(size)
        x, y, _ = size.size
        if y < NARROWEST:
            raise InputError(f"a jug of {1000 * y:.0f} mm across has no room inside its walls")
        if x < y + 2 * LEAST:
            raise InputError(
                f"a jug is longer than wide by its spout and its handle, {2000 * LEAST:.0f} mm at least: "
                f"found {1000 * x:.0f} by {1000 * y:.0f} mm"
            )

    def shape(self, size: ShapeSize) -> Shape:
        """See `ShapeKind.shape`."""
        x, y, height = size.size
        radius, beyond, h, base = y / 2, (x - y) / 2, height / 2, min(BASE, height / 4)
        pieces: list[Piece] = [floor_piece(radius, -h, base - h)]
        neck = h - LIP * height
        for side in range(SIDES):
            spout = side in (0, 1, SIDES - 1)
            pieces.append(_flat(side, radius, base - h, neck if spout else h))
        pieces += [
            leaning_piece(side, [(neck, radius, radius), (h, *reach)], WALL)
            for side, reach in (
                (0, (radius + beyond, radius + beyond)),
                (1, (radius + beyond, radius)),
                (SIDES - 1, (radius, radius + beyond)),
            )
        ]
        pieces += _handle(radius, beyond, h)
        corners = tuple(piece.corners() for piece in pieces)
        return Shape(
            extent=size.size,
            collision=tuple(pieces),
            draw=lambda: meshes.hulls(corners),
            weigh=lambda: meshes.mass_properties(meshes.hulls(corners)),
            surface=PrismSurface(Ellipse(radius, radius), h),
        )

    def grasp_axes(self, size: ShapeSize) -> tuple[GraspAxis, ...]:
        """See `ShapeKind.grasp_axes`."""
        return (((0.0, 1.0, 0.0), size.size[1]),)

    def grips(self, size: ShapeSize) -> Grips:
        """See `ShapeKind.grips`: about its body."""
        _, y, z = size.size
        return elliptic_grips((y, y, z), HOLLOW_FIRM, lids=False)


def _flat(side: int, radius: float, low: float, high: float) -> BoxPiece:
    """A side's upright wall: a box, whose outer face lies on the outer surface, flat where fingers close."""
    angle, middle = 2 * math.pi * side / SIDES, radius - WALL / 2
    position = [middle * math.cos(angle), middle * math.sin(angle), (low + high) / 2]
    half = np.array([WALL / 2, radius * math.tan(math.pi / SIDES), (high - low) / 2])
    return BoxPiece(poses.pose(position, poses.yaw(angle)), half)


def _handle(radius: float, beyond: float, half_height: float) -> list[Piece]:
    """Three bars."""
    thick = min(HANDLE, beyond / 2)
    high, low = 0.6 * half_height, -0.6 * half_height
    outer = -(radius + beyond)
    inner = -(radius - WALL / 2)
    bars = [
        ((outer, outer + thick), (low, high)),
        ((outer + thick, inner), (high - thick, high)),
        ((outer + thick, inner), (low, low + thick)),
    ]
    return [
        BoxPiece(
            poses.pose([sum(across) / 2, 0.0, sum(up) / 2]),
            np.array([(across[1] - across[0]) / 2, thick / 2, (up[1] - up[0]) / 2]),
        )
        for across, up in bars
    ]
