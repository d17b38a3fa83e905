"""How things are in holes: how deep, and whether all that is below the mouth is between the walls."""

from __future__ import annotations

from typing import NamedTuple

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.scene.spatial_laws import Whereabouts

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
