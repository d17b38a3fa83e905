"""Convex pieces in space as coal's shapes."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.narrow_phase import coal
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.geometry import BoxPiece, Piece

_KEPT = 1024
"""Hulls that are remembered."""


def convex(corners: Array) -> Any:
    """The convex hull of corners ``(n, 3)`` as coal's shape, one of its own for each who asks."""
    return _hull(np.ascontiguousarray(corners, float).tobytes()).clone()


def placed(piece: Piece, pose: Array) -> tuple[Any, Any]:
    """A piece of a body at ``pose (7,)`` as coal's shape, and where it is."""
    if isinstance(piece, BoxPiece):
        frame, form = poses.multiply(pose, piece.pose), coal.Box(*(2 * piece.half_size).tolist())
    else:
        frame, form = pose, convex(np.asarray(piece.vertices, float))
    return form, coal.Transform3s(poses.to_matrix(frame[3:]), frame[:3])


@lru_cache(maxsize=_KEPT)
def _hull(corners: bytes) -> Any:
    """The hull of corners; to make one takes a millisecond, and the same things are asked about again."""
    points = coal.StdVec_Vec3s()
    for corner in np.frombuffer(corners).reshape(-1, 3):
        points.append(corner)
    return coal.Convex.convexHull(points, False, "")
