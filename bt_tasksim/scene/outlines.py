"""Outlines of things from above: convex polygons with a lowest and a highest point, and their distances.

Things stand upright on level places nearly always, so two things are clear of each other where they are at
different heights, or their outlines apart. The outline of what is tilted is its shadow, which is no smaller.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.fixtures import Fixture
from bt_tasksim.scene.geometry import BoxPiece, Piece

TOUCHING = 5e-4
"""Metres of overlap that count as touching."""


@dataclass(frozen=True, eq=False)
class Slab:
    """A convex piece from above: outline ``(n, 2)``, counter-clockwise, lowest and highest point, metres."""

    outline: Array
    low: float
    high: float

    def level_with(self, other: Slab) -> bool:
        """Some part of it is as high as some part of the other."""
        return self.high - other.low > TOUCHING and other.high - self.low > TOUCHING


def slabs(pieces: Sequence[Piece], pose: Array) -> tuple[Slab, ...]:
    """Convex pieces from above.

    Args:
        pieces: Of one thing, in its frame.
        pose: Pose ``(7,)`` of that frame.
    """
    out = []
    for piece in pieces:
        corners = poses.transform(pose, piece.corners())
        heights = corners[:, 2]
        out.append(Slab(hull(corners[:, :2]), float(heights.min()), float(heights.max())))
    return tuple(out)


@lru_cache(maxsize=64)
def fixture_slabs(fixture: Fixture) -> tuple[Slab, ...]:
    """The boxes of a fixture from above."""
    boxes = [BoxPiece(np.array(box.pose), np.array(box.size) / 2) for box in fixture.boxes]
    return slabs(boxes, fixture.pose_array())


@lru_cache(maxsize=64)
def fixture_bounds(fixture: Fixture) -> tuple[Array, Array]:
    """Lowest and highest corners ``(boxes, 3)`` of what is about each box of a fixture, metres."""
    parts = fixture_slabs(fixture)
    low = [[*part.outline.min(axis=0), part.low] for part in parts]
    high = [[*part.outline.max(axis=0), part.high] for part in parts]
    return np.array(low).reshape(-1, 3), np.array(high).reshape(-1, 3)


def whole_outline(parts: Sequence[Slab]) -> Array:
    """The convex outline ``(n, 2)`` of all parts together."""
    return hull(np.concatenate([part.outline for part in parts]))


def overlapping(some: Sequence[Slab], others: Sequence[Slab], gap: float) -> bool:
    """Some part of one is nearer than ``gap`` metres to a part of the other at the same height.

    Args:
        some: Parts of one thing.
        others: Parts of the other one.
        gap: Metres; a negative one allows an overlap.
    """
    return any(
        a.level_with(b) and _boxes_within(a.outline, b.outline, gap) and distance(a.outline, b.outline) < gap
        for b in others
        for a in some
    )


def deepest(some: Sequence[Slab], others: Sequence[Slab]) -> float:
    """Metres to which a part of one reaches into one of the other at the same height; 0 where none does."""
    found = [-distance(a.outline, b.outline) for a in some for b in others if a.level_with(b)]
    return max([depth for depth in found if depth > 0.0], default=0.0)


def distance(a: Array, b: Array) -> float:
    """Metres between two convex outlines ``(n, 2)`` and ``(m, 2)``; where they overlap, minus the depth.

    The depth is the shortest way on which one leaves the other: separating axes are the edges' normals.
    """
    apart = max(_along_normals(a, b), _along_normals(b, a))
    if apart <= 0.0:
        return apart
    return min(_to_edges(a, b), _to_edges(b, a))


def nearest_way(a: Array, b: Array) -> tuple[float, Array]:
    """Metres between two convex outlines, and the unit vector ``(2,)`` from the first one to the second.

    It is the shortest way; where they touch, or overlap, that along which they overlap least.
    """
    gap = distance(a, b)
    if gap > TOUCHING:
        ways = np.concatenate([_from_edges(a, b), -_from_edges(b, a)])
        lengths = np.linalg.norm(ways, axis=1)
        return gap, ways[lengths.argmin()] / lengths.min()
    normals = np.concatenate([_normals(a, np.roll(a, -1, axis=0)), -_normals(b, np.roll(b, -1, axis=0))])
    apart = np.min(normals @ b.T, axis=1) - np.max(normals @ a.T, axis=1)
    return gap, normals[apart.argmax()]


def holds(outline: Array, points: Array, margin: float = 0.0) -> bool:
    """All points ``(k, 2)`` lie within a convex outline, ``margin`` metres from its edges at least."""
    return bool(np.all(within(outline, points) >= margin))


def within(outline: Array, points: Array) -> Array:
    """Metres ``(k,)`` from points ``(k, 2)`` to a convex outline's nearest edge; negative outside."""
    ends = np.roll(outline, -1, axis=0)
    normals = _normals(outline, ends)
    found: Array = (np.sum(normals * outline, axis=1) - points @ normals.T).min(axis=1)
    return found


def rectangle(pose: Array, centre: Sequence[float], extent: Sequence[float]) -> Array:
    """The outline ``(4, 2)`` of a level rectangle.

    Args:
        pose: Pose ``(7,)`` of the frame that it lies in.
        centre: Its middle ``(2,)`` in that frame, metres.
        extent: Its full size ``(2,)``, metres.
    """
    signs = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    flat = np.array(centre) + signs * np.array(extent) / 2
    return hull(poses.transform(pose, np.column_stack([flat, np.zeros(4)]))[:, :2])


def hull(points: Array) -> Array:
    """Corners ``(m, 2)`` of the convex hull of points ``(n, 2)``, counter-clockwise.

    Source: A. M. Andrew, "Another efficient algorithm for convex hulls in two dimensions", 1979.
    """
    ordered = np.unique(np.round(points, 12), axis=0).tolist()
    if len(ordered) < 3:
        return np.array(ordered)

    def half(line: list[list[float]]) -> list[list[float]]:
        kept: list[list[float]] = []
        for x, y in line:
            while len(kept) > 1:
                (ax, ay), (bx, by) = kept[-2:]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 1e-15:
                    break
                kept.pop()
            kept.append([x, y])
        return kept[:-1]

    return np.array(half(ordered) + half(ordered[::-1]))


def _boxes_within(a: Array, b: Array, gap: float) -> bool:
    """The boxes about two outlines are nearer than this: a quick first look."""
    clear = np.maximum(b.min(axis=0) - a.max(axis=0), a.min(axis=0) - b.max(axis=0))
    return bool(np.all(clear < gap))


def _normals(starts: Array, ends: Array) -> Array:
    along = ends - starts
    outward = np.column_stack([along[:, 1], -along[:, 0]])
    lengths = np.linalg.norm(outward, axis=1, keepdims=True)
    return outward / np.where(lengths > 0.0, lengths, 1.0)


def _along_normals(a: Array, b: Array) -> float:
    normals = _normals(a, np.roll(a, -1, axis=0))
    return float(np.max(np.min(normals @ b.T, axis=1) - np.sum(normals * a, axis=1)))


def _to_edges(points: Array, outline: Array) -> float:
    """Metres from the nearest of some points to the nearest edge of an outline."""
    return float(np.min(np.linalg.norm(_from_edges(points, outline), axis=1)))


def _from_edges(points: Array, outline: Array) -> Array:
    """Vectors ``(k, 2)`` from each of some points to the nearest place on each edge of an outline."""
    along = np.roll(outline, -1, axis=0) - outline
    from_start = points[:, None, :] - outline
    lengths = np.maximum(np.sum(along * along, axis=1), 1e-24)
    share = np.clip(np.sum(from_start * along, axis=2) / lengths, 0.0, 1.0)
    found: Array = (share[..., None] * along - from_start).reshape(-1, 2)
    return found
