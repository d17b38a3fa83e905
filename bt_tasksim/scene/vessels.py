"""Open round vessels: a floor, and walls of convex pieces around it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bt_tasksim.scene.geometry import ConvexPiece, upright_piece
from bt_tasksim.scene.meshes import circumscribed_circle

SIDES = 16
"""Flat sides around; two of them lie across the y axis, along which fingers close."""


def floor_piece(radius: float, low: float, high: float) -> ConvexPiece:
    """The floor, between two heights, metres."""
    return upright_piece(circumscribed_circle(SIDES) * radius, low, high)


def wall_piece(side: int, ends: tuple[tuple[float, float], ...], wall: float) -> ConvexPiece:
    """A side's wall.

    Args:
        side: Its number.
        ends: At its lower and at its upper end: height, and outer radius at its two corners in one, metres.
        wall: Its thickness, metres.
    """
    return leaning_piece(side, [(height, radius, radius) for height, radius in ends], wall)


def leaning_piece(side: int, ends: Sequence[tuple[float, float, float]], wall: float) -> ConvexPiece:
    """A side's wall whose corners may be unlike.

    Args:
        side: Its number.
        ends: At its lower and at its upper end: height, and distance of its outer face from the axis at its
            first and at its second corner, metres; the distance of the corner itself is a little more.
        wall: Its thickness, metres.
    """
    found, longer = [], 1.0 / math.cos(math.pi / SIDES)
    for height, *radii in ends:
        for corner, radius in zip((-0.5, 0.5), radii, strict=True):
            angle = 2.0 * math.pi * (side + corner) / SIDES
            way = np.array([math.cos(angle), math.sin(angle)])
            found += [[*(longer * out * way), height] for out in (radius, radius - wall)]
    vertices = np.array(found)
    vertices.setflags(write=False)
    return ConvexPiece(vertices)
