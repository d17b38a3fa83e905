"""How thick a body is along lines through it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from bt_tasksim.core.poses import Array

_KEPT = 1024
"""Pieces whose faces are remembered."""
_LEVEL = 1e-9


def chords(pieces: Sequence[Array], points: Array, directions: Array) -> Array:
    """Metres ``(m,)`` from where a line enters a body to where it leaves it; 0 where it misses it.

    Args:
        pieces: Corners ``(n, 3)`` of each of the body's convex pieces, metres.
        points: A point ``(m, 3)`` on each line.
        directions: Unit vectors ``(m, 3)`` along them.
    """
    enters, leaves = np.full(len(points), np.inf), np.full(len(points), -np.inf)
    for piece in pieces:
        planes = faces(piece)
        beyond = points @ planes[:, :3].T + planes[:, 3]  # positive outside
        slope = directions @ planes[:, :3].T
        flat = np.abs(slope) < _LEVEL
        at = -beyond / np.where(flat, 1.0, slope)
        first = np.max(np.where(~flat & (slope < 0.0), at, -np.inf), axis=-1)
        last = np.min(np.where(~flat & (slope > 0.0), at, np.inf), axis=-1)
        met = (first < last) & ~np.any(flat & (beyond > 0.0), axis=-1)
        enters = np.where(met, np.minimum(enters, first), enters)
        leaves = np.where(met, np.maximum(leaves, last), leaves)
    return np.where(leaves > enters, leaves - enters, 0.0)


def faces(corners: Array) -> Array:
    """The planes ``(f, 4)`` of the hull of ``corners (n, 3)``.

    Outward unit normals, and minus their distance from zero.
    """
    return _faces(np.ascontiguousarray(corners, float).tobytes())


@lru_cache(maxsize=_KEPT)
def _faces(corners: bytes) -> Array:
    from scipy.spatial import ConvexHull

    found: Array = ConvexHull(np.frombuffer(corners).reshape(-1, 3)).equations
    return found
