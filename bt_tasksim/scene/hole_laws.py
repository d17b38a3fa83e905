"""How things are in holes: how deep, and whether all that is below the mouth is between the walls."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.scene.spatial_laws import Whereabouts

_CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
PLAY = 0.002
"""Metres by which a corner may seem to be in a wall: estimates are as wrong as that."""


class InHole(NamedTuple):
    """How something is in a hole, in ``N`` worlds.

    Attributes:
        depth: How deep its lowest point is below the mouth ``(N,)``, metres; negative above it.
        missing: How far that point is from the stop ``(N,)``, metres.
        aside: How far what is below the mouth is beyond the walls ``(N,)``, metres; of what is above it, its
            lowest point; negative between them.
    """

    depth: Array
    missing: Array
    aside: Array

    def holds(self, tolerance: float) -> Array:
        """Booleans ``(N,)``: it is in the hole, and no farther from its stop than that."""
        return (self.depth > 0.0) & (self.missing <= tolerance) & (self.aside <= PLAY)


def in_hole(where: Whereabouts, name: str, hole: str) -> InHole:
    """How an object is in a hole, or in the hollow of what has one.

    Args:
        where: Where everything is.
        name: The object.
        hole: A place of the kind ``hole``.
    """
    body, hollow = where.body(name), where.hollow(hole)
    xp = array_namespace(body.pose)
    corners = poses.transform(body.pose[:, None, :], body.corners)
    local = poses.localise(hollow.frame[:, None, :], corners)
    box = hollow.boxes[:, 0, :]
    low = xp.min(local[..., 2], axis=-1)
    beyond = xp.max(abs(local[..., :2] - box[:, None, :2]) - box[:, None, 2:4], axis=-1)
    deep = (local[..., 2] < box[:, None, 5]) | (local[..., 2] <= low[:, None] + PLAY)
    aside = xp.max(xp.where(deep, beyond, xp.full_like(beyond, -1.0)), axis=-1)
    return InHole(box[:, 5] - low, low - box[:, 4], aside)


def beyond_hole(where: Whereabouts, name: str, hole: str) -> Array:
    """How far ``(N,)`` an object is out of a hole, metres; 0 where some of it is between the walls.

    What counts are gaps along the axes of the hole and of the object.
    """
    body, hollow = where.body(name), where.hollow(hole)
    xp = array_namespace(body.pose)
    box = hollow.boxes[:, 0, :]
    middle = xp.concat([box[:, :2], (box[:, 4:5] + box[:, 5:]) / 2], axis=-1)
    half = xp.concat([box[:, 2:4], (box[:, 5:] - box[:, 4:5]) / 2], axis=-1)
    walls = middle[:, None, :] + constant(_CORNERS, half) * half[:, None, :]
    corners = poses.transform(body.pose[:, None, :], body.corners)
    from_hole = _apart(poses.localise(hollow.frame[:, None, :], corners), walls)
    walls = poses.localise(body.pose[:, None, :], poses.transform(hollow.frame[:, None, :], walls))
    return poses.clip(xp.maximum(from_hole, _apart(walls, body.corners)), 0.0, math.inf)


def _apart(some: Array, others: Array) -> Array:
    """The largest gap ``(N,)`` along an axis between points ``(N, n, 3)`` and others ``(N, m, 3)``, m."""
    xp = array_namespace(some)
    above = xp.min(some, axis=1) - xp.max(others, axis=1)
    below = xp.min(others, axis=1) - xp.max(some, axis=1)
    return xp.max(xp.maximum(above, below), axis=-1)
