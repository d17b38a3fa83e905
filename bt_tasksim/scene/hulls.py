"""Convex pieces in space as coal's shapes."""

from __future__ import annotations

from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.convex_hulls import convex
from bt_tasksim.core.narrow_phase import coal
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.geometry import BallPiece, BoxPiece, Piece


def placed(piece: Piece, pose: Array) -> tuple[Any, Any]:
    """A piece of a body at ``pose (7,)`` as coal's shape, and where it is.

    Raises:
        NoVolumeError: The piece is no body.
    """
    if isinstance(piece, BoxPiece):
        frame, form = poses.multiply(pose, piece.pose), coal.Box(*(2 * piece.half_size).tolist())
    elif isinstance(piece, BallPiece):
        frame, form = poses.multiply(pose, poses.pose(piece.middle)), coal.Sphere(piece.radius)
    else:
        frame, form = pose, convex(np.asarray(piece.vertices, float))
    return form, coal.Transform3s(poses.to_matrix(frame[3:]), frame[:3])
