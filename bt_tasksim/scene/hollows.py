"""The hollow of a thing: where something may lie within it, as upright boxes in the thing's own frame.

A point is in the hollow where the thing has a floor below it and walls around it: straight down from it, and
level in nearly all directions, one meets the thing. So a mug is hollow up to its rim, and the opening of its
handle is none, which is open to both sides; nor has a ring or a tube a hollow, through which things fall.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bt_tasksim.core.poses import Array

CELLS = 20
"""Columns along each side of the bounding box; 4 mm wide in a mug."""
LEVELS = 16
"""Heights at which walls are looked for."""
LINES = 8
"""Level lines through a point, so twice as many directions in which there has to be a wall."""
ESCAPES = 1
"""Of these directions so many may meet none: convex parts of a solid leave cracks between them."""
TURNED = 0.1
"""Radians by which the first line is turned from the x axis, along which parts are often cut."""
LAPPED = 1e-6
"""Metres by which columns lap over their neighbours, so that nothing falls between them."""
MOST = 192
"""Corners of a hull that are kept."""
_STILL = 1e-9
NOTHING = (0.0, 0.0, 0.0, 0.0, np.inf, -np.inf)
"""A box in which nothing is."""


def hollow(pieces: Sequence[Array], extent: Sequence[float]) -> Array:
    """The hollow of a solid: boxes ``(k, 6)``, none where it has none.

    Each is given by its middle (x, y), its half size (x, y), its floor and its rim (z), in the frame of the
    solid, metres.

    Args:
        pieces: Corners ``(n, 3)`` of the convex pieces that together are the solid.
        extent: Full size ``(3,)`` of its bounding box, whose middle is the frame's origin.
    """
    planes = [found for piece in pieces if (found := _planes(piece)) is not None]
    if len(planes) < 2:  # what is convex has no hollow
        return np.zeros((0, 6))
    cells, step = columns(extent), extent[2] / LEVELS
    flat, levels = cells[:, :2], _middles(extent[2], LEVELS)
    floor, open_ = _columns(planes, flat, levels)
    cell, level = np.nonzero(open_ & np.isfinite(floor))
    walled = np.zeros_like(open_)
    points = np.column_stack([flat[cell], levels[level]])
    walled[cell, level] = _walled(planes, points)
    found = []
    for k in np.flatnonzero(walled.any(axis=1)).tolist():
        for low in np.unique(floor[k, walled[k]]).tolist():
            (above,) = np.nonzero(floor[k] == low)
            count = int(np.argmin([*walled[k, above], False]))  # from the floor up to the first gap
            if count:
                rim = levels[above[count - 1]] + step / 2
                found.append([*cells[k], low, rim])
    return np.array(found, float).reshape(-1, 6)


def outer_corners(pieces: Sequence[Array]) -> Array:
    """Corners ``(n, 3)`` of the convex hull of pieces, each given by its corners ``(n, 3)``, metres.

    Where they are many, those `MOST` that reach farthest in directions all around.
    """
    from scipy.spatial import ConvexHull, QhullError

    corners = np.unique(np.round(np.concatenate(pieces), 12), axis=0)
    try:
        found = corners[np.sort(ConvexHull(corners).vertices)]
    except QhullError:
        found = corners
    if len(found) > MOST:
        found = found[np.unique(np.argmax(found @ _all_around(MOST).T, axis=0))]
    found.setflags(write=False)
    return found


def _all_around(count: int) -> Array:
    """Directions ``(count, 3)`` about evenly over the sphere.

    Source: R. Swinbank and R. J. Purser, "Fibonacci grids: A novel approach to global modelling", Quarterly
    Journal of the Royal Meteorological Society 132, 2006.
    """
    k = np.arange(count) + 0.5
    height, angle = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    level = np.sqrt(1.0 - height**2)
    return np.column_stack([level * np.cos(angle), level * np.sin(angle), height])


def columns(extent: Sequence[float]) -> Array:
    """The columns at which a solid of this full size is looked at: middles and half sizes ``(cells, 4)``."""
    x, y = np.meshgrid(*(_middles(size, CELLS) for size in extent[:2]), indexing="ij")
    half = np.array(extent[:2], float) / CELLS / 2 + LAPPED
    return np.concatenate([x.reshape(-1, 1), y.reshape(-1, 1), np.tile(half, (CELLS**2, 1))], axis=1)


def _middles(size: float, count: int) -> Array:
    """Middles ``(count,)`` of equal parts of a length about 0."""
    found: Array = size * ((np.arange(count) + 0.5) / count - 0.5)
    return found


def _planes(corners: Array) -> Array | None:
    """Planes ``(f, 4)`` about a convex piece, outward normals and offsets; None where it has no volume."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        found: Array = np.unique(np.round(ConvexHull(corners).equations, 9), axis=0)
    except QhullError:
        return None
    return found


def _columns(planes: Sequence[Array], flat: Array, levels: Array) -> tuple[Array, Array]:
    """Height ``(cells, levels)`` of what is below, minus infinity where nothing is; and whether it is free.

    Args:
        planes: Of the pieces.
        flat: Where the columns are ``(cells, 2)``.
        levels: Heights ``(levels,)``.
    """
    up, ground = np.array([0.0, 0.0, 1.0]), np.column_stack([flat, np.zeros(len(flat))])
    floor = np.full((len(flat), len(levels)), -np.inf)
    free = np.ones(floor.shape, bool)
    for piece in planes:
        low, high = (ends[:, None] for ends in _crossed(piece, ground, up))
        met = low < high
        floor = np.where(met & (high <= levels), np.maximum(floor, high), floor)
        free &= ~(met & (low < levels) & (levels < high))
    return np.round(floor, 6), free  # pieces side by side differ in their last digits


def _walled(planes: Sequence[Array], points: Array) -> Array:
    """Booleans ``(k,)``: there are walls around ``points (k, 3)``."""
    escapes = np.zeros(len(points), int)
    for line in range(LINES):
        angle = TURNED + np.pi * line / LINES
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        (left,) = np.nonzero(escapes <= ESCAPES)
        ahead, behind = np.zeros((2, len(left)), bool)
        for piece in planes:
            low, high = _crossed(piece, points[left], way)
            met = low < high
            ahead |= met & (high > 0.0)
            behind |= met & (low < 0.0)
        escapes[left] += (~ahead).astype(int) + ~behind
    found: Array = escapes <= ESCAPES
    return found


def _crossed(planes: Array, points: Array, way: Array) -> tuple[Array, Array]:
    """Where lines enter and leave a convex piece: metres ``(k,)`` from ``points (k, 3)`` along ``way (3,)``.

    A line that misses it enters after it leaves.
    """
    outside = points @ planes[:, :3].T + planes[:, 3]
    slope = planes[:, :3] @ way
    along = np.abs(slope) < _STILL
    at = -outside / np.where(along, 1.0, slope)
    low = np.max(np.where(slope < -_STILL, at, -np.inf), axis=1)
    high = np.min(np.where(slope > _STILL, at, np.inf), axis=1)
    beside = np.any(along & (outside > 0.0), axis=1)
    return np.where(beside, np.inf, low), np.where(beside, -np.inf, high)
