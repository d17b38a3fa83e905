"""Where the front or the back of solids is, at some heights and at places across the way that they go.

Solids are convex pieces, cut by level planes; of each cut only its outline across the way is kept.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.outlines import hull

_KEPT = 1024
"""Pieces whose edges are remembered."""
_FEW = 12
"""Points of which all pairs are looked at sooner than their hull is found."""


class ConvexSolid(NamedTuple):
    """A convex piece.

    Attributes:
        corners: ``(n, 3)``, metres.
        edges: Pairs ``(m, 2)`` of corners, among which the edges of their hull are.
    """

    corners: Array
    edges: Array


def solids(pieces: Sequence[Array], pose: Array | None = None) -> list[ConvexSolid]:
    """Convex pieces, each by its corners ``(n, 3)``, in the frame in which their own has a pose ``(7,)``."""
    found = [ConvexSolid(np.asarray(piece, float), _edges_of(piece)) for piece in pieces]
    return found if pose is None else moved(found, pose)


def moved(pieces: Sequence[ConvexSolid], pose: Array) -> list[ConvexSolid]:
    """The same pieces in the frame in which their own one has a pose ``(7,)``."""
    return [piece._replace(corners=poses.transform(pose, piece.corners)) for piece in pieces]


def fronts(pieces: Sequence[ConvexSolid], heights: Array, across: Array) -> Array:
    """How far pieces reach along the first axis ``(h, g)``; minus infinity where none is.

    Args:
        pieces: Their axes are along the way, across it, and up.
        heights: Heights ``(h,)`` of the cuts, metres.
        across: Places ``(g,)`` across the way, metres.
    """
    found = np.full((len(heights), len(across)), -np.inf)
    for piece in pieces:
        low, high = float(piece.corners[:, 2].min()), float(piece.corners[:, 2].max())
        for row in np.flatnonzero((low <= heights) & (heights < high)):
            cut = section(piece, float(heights[row]))
            if len(cut):
                found[row] = np.maximum(found[row], _front(*_lines(cut), across))
    return found


def section(piece: ConvexSolid, height: float) -> Array:
    """Points ``(k, 2)`` whose hull is the cut of a piece by the level plane at a height; none beside it."""
    ends = piece.corners[piece.edges]
    heights = ends[..., 2]
    cut = (heights.min(axis=1) <= height) & (height < heights.max(axis=1))
    low, high = ends[cut, 0], ends[cut, 1]
    share = (height - low[:, 2]) / (high[:, 2] - low[:, 2])
    found: Array = low[:, :2] + share[:, None] * (high[:, :2] - low[:, :2])
    return found


def _lines(points: Array) -> tuple[Array, Array]:
    """Ends ``(k, 2)`` of lines among which the edges of the hull of points ``(n, 2)`` are."""
    if len(points) > _FEW:
        outline = hull(points)
        return outline, np.roll(outline, -1, axis=0)
    first, second = _pairs(len(points))
    return points[first], points[second]


@lru_cache(maxsize=2 * _FEW)
def _pairs(count: int) -> tuple[Array, Array]:
    return np.triu_indices(count)


def _front(a: Array, b: Array, across: Array) -> Array:
    """How far lines from ``a (k, 2)`` to ``b (k, 2)`` reach along the first axis at places ``(g,)``."""
    a, b = a[:, :, None], b[:, :, None]
    wide = b[:, 1] - a[:, 1]
    share = (across - a[:, 1]) / np.where(wide == 0.0, 1.0, wide)
    along = np.where(wide == 0.0, np.maximum(a[:, 0], b[:, 0]), a[:, 0] + share * (b[:, 0] - a[:, 0]))
    within = (np.minimum(a[:, 1], b[:, 1]) <= across) & (across <= np.maximum(a[:, 1], b[:, 1]))
    found: Array = np.where(within, along, -np.inf).max(axis=0)
    return found


def _edges_of(corners: Array) -> Array:
    return _edges(np.ascontiguousarray(corners, float).tobytes())


@lru_cache(maxsize=_KEPT)
def _edges(corners: bytes) -> Array:
    from scipy.spatial import ConvexHull, QhullError

    points = np.frombuffer(corners).reshape(-1, 3)
    try:
        faces = ConvexHull(points).simplices
    except QhullError:  # it is flat, or has few corners: all pairs will do
        return np.array(list(itertools.combinations(range(len(points)), 2)), int).reshape(-1, 2)
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    found: Array = np.unique(np.sort(pairs, axis=1), axis=0)
    return found
