"""Convex hulls of corners as coal's shapes."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from bt_tasksim.core.errors import NoVolumeError
from bt_tasksim.core.narrow_phase import coal
from bt_tasksim.core.poses import Array

_KEPT = 1024
"""Hulls that are remembered."""
FLAT = 1e-9
"""Metres below which corners lie in a plane: coal's hulls need a volume, and end the process without one."""


def convex(corners: Array) -> Any:
    """The convex hull of corners ``(n, 3)`` as coal's shape, one of its own for each who asks.

    Raises:
        NoVolumeError: The corners are not finite, or lie in one plane.
    """
    return _hull(np.ascontiguousarray(corners, float).tobytes()).clone()


def check_volume(corners: Array) -> None:
    """Refuse corners ``(n, 3)`` whose hull is no body.

    Raises:
        NoVolumeError: They are not finite, or lie in one plane.
    """
    if len(corners) < 4 or not np.isfinite(corners).all():
        raise NoVolumeError("a convex piece needs at least four corners with finite coordinates")
    if float(np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)[-1]) < FLAT:
        raise NoVolumeError("the corners of a convex piece lie in one plane: it needs a volume")


@lru_cache(maxsize=_KEPT)
def _hull(corners: bytes) -> Any:
    """The hull of corners; to make one takes a millisecond, and the same things are asked about again."""
    given = np.frombuffer(corners).reshape(-1, 3)
    check_volume(given)
    points = coal.StdVec_Vec3s()
    for corner in given:
        points.append(corner)
    return coal.Convex.convexHull(points, False, "")
