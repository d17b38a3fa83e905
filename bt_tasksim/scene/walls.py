"""Walls: what is beside a thing, as high as it, and how far away; the law for truth and estimates alike."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.scene.outlines import Slab, nearest_way

CLOSE = 0.003
"""Metres from it within which a thing is against a wall."""
WALL = 0.005
"""Metres by which a wall is higher than the foot of what is against it, at least."""


class Wall(NamedTuple):
    """The nearest wall of a thing.

    Attributes:
        gap: Metres to it; negative where they overlap.
        towards: Level unit vector ``(3,)`` in which the thing comes to it.
    """

    gap: float
    towards: Array


def nearest_wall(parts: Sequence[Slab], around: Sequence[Slab]) -> Wall | None:
    """The nearest of what is around a thing that is a wall beside it; None where there is none.

    A wall is as high as the thing somewhere, and not what that stands on.

    Args:
        parts: Convex parts of the thing.
        around: Those of what may be a wall.
    """
    if not parts:
        return None
    foot, head = min(part.low for part in parts), max(part.high for part in parts)
    walls = [wall for wall in around if wall.high > foot + WALL and wall.low < head]
    ways = [nearest_way(part.outline, wall.outline) for part in parts for wall in walls]
    if not ways:
        return None
    gap, way = min(ways, key=lambda found: round(found[0], 9))
    return Wall(round(gap, 9), np.append(np.round(way, 9), 0.0))
