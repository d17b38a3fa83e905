"""Where an outline has room among others, all seen from above.

An outline at a point is clear of another one where the point is clear of the two outlines' Minkowski
difference (T. Lozano-Pérez, "Spatial planning: a configuration space approach", IEEE Transactions on
Computers, 1983).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.scene.outlines import hull


class Room:
    """What an outline keeps clear of, in the plane.

    Args:
        outline: Corners ``(n, 2)`` of the outline about its own origin, metres.
        others: Convex outlines ``(m, 2)`` of what is around.
    """

    def __init__(self, outline: Array, others: Sequence[Array]) -> None:
        self._blocked = [hull((other[:, None] - outline[None]).reshape(-1, 2)) for other in others]

    def gaps(self, points: Array) -> Array:
        """Metres ``(k,)`` from the outline at ``points (k, 2)`` to the nearest of the others.

        Negative where they overlap, infinite where there are no others.
        """
        found = np.full(len(points), np.inf)
        for blocked in self._blocked:
            found = np.minimum(found, outside(points, blocked))
        return found

    def beside(self, directions: Array, gap: float) -> Array:
        """Points ``(k, 2)`` at which the outline has a gap to the first of the others.

        Args:
            directions: Unit vectors ``(k, 2)`` from a point within the other one.
            gap: Metres.
        """
        corners = self._blocked[0]
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        low = np.zeros(len(directions))
        high = low + float(np.max(np.linalg.norm(corners - middle, axis=1))) + 2.0 * gap
        for _ in range(_HALVINGS):
            half = (low + high) / 2
            near = outside(middle + half[:, None] * directions, corners) < gap
            low, high = np.where(near, half, low), np.where(near, high, half)
        found: Array = middle + high[:, None] * directions
        return found


_HALVINGS = 20


def outside(points: Array, outline: Array) -> Array:
    """Metres ``(k,)`` from ``points (k, 2)`` to a convex outline ``(n, 2)``; negative within it."""
    along = np.roll(outline, -1, axis=0) - outline
    lengths = np.maximum(np.linalg.norm(along, axis=1), 1e-12)
    normals = np.stack([along[:, 1], -along[:, 0]], axis=-1) / lengths[:, None]
    away = points[:, None] - outline[None]
    depth = np.max(np.sum(away * normals, axis=2), axis=1)
    share = np.clip(np.sum(away * along, axis=2) / lengths**2, 0.0, 1.0)
    nearest = np.min(np.linalg.norm(away - share[..., None] * along, axis=2), axis=1)
    found: Array = np.where(depth > 0.0, nearest, depth)
    return found
