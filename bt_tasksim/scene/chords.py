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
        faces = _faces(np.ascontiguousarray(piece, float).tobytes())
        beyond = points @ faces[:, :3].T + faces[:, 3]  # positive outside
        slope = directions @ faces[:, :3].T
        flat = np.abs(slope) < _LEVEL
        at = -beyond / np.where(flat, 1.0, slope)
        first = np.max(np.where(~flat & (slope < 0.0), at, -np.inf), axis=-1)
        last = np.min(np.where(~flat & (slope > 0.0), at, np.inf), axis=-1)
        met = (first < last) & ~np.any(flat & (beyond > 0.0), axis=-1)
        enters = np.where(met, np.minimum(enters, first), enters)
        leaves = np.where(met, np.maximum(leaves, last), leaves)
    return np.where(leaves > enters, leaves - enters, 0.0)


@lru_cache(maxsize=_KEPT)
def _faces(corners: bytes) -> Array:
    """The planes ``(f, 4)`` of a convex hull: outward unit normals, and minus their distance from zero."""
    from scipy.spatial import ConvexHull

    found: Array = ConvexHull(np.frombuffer(corners).reshape(-1, 3)).equations
    return found
