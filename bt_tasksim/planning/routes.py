"""Motions that were searched for, put among the paths of a batch of worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.transfer import fetched
from bt_tasksim.planning.arm import Arm
from bt_tasksim.planning.reference_motion import Path, minimum_jerk
from bt_tasksim.planning.route import Pace, Route, followed, hurries

SAMPLES = 97
"""Rows of the table of a path that may hold a route: one for each control period of some five seconds."""
EVERY = 4
"""Rows from one for which joints are computed to the next; it divides `SAMPLES` less one."""


def with_routes(path: Path, routes: Mapping[int, Sequence[Route]], arm_joints: int) -> Path:
    """Paths of which those of some worlds are routes, one after the other, each from rest to rest.

    Args:
        path: Paths of all worlds, with `SAMPLES` rows.
        routes: By the number of the world.
        arm_joints: How many the arm has.
    """
    worlds, n = path.table.shape[:2]
    xp, like = array_namespace(path.table), path.table
    nothing = xp.full((worlds, n, arm_joints), xp.nan, dtype=like.dtype, device=like.device)
    even = xp.zeros((worlds,), dtype=xp.bool, device=like.device)
    if not routes:
        return path._replace(joints=nothing, even=even)
    tools, joints, durations = (
        np.zeros((worlds, n, 7)),
        np.full((worlds, n, arm_joints), np.nan),
        np.ones(worlds),
    )
    tools[..., 3] = 1.0
    found = np.zeros(worlds, bool)
    for world, pieces in routes.items():
        tools[world], joints[world], durations[world] = _in_time(pieces, n, arm_joints)
        found[world] = True
    there = xp.asarray(found, device=like.device)
    return Path(
        xp.where(there[:, None, None], constant(tools, like), path.table),
        xp.where(there, constant(durations, like), path.duration),
        xp.where(there[:, None, None], constant(joints, like), nothing),
        there,
    )


def in_postures(path: Path, ways: Mapping[int, Array]) -> Path:
    """Paths of which those of some worlds are followed in the postures in which the arm was looked at.

    Args:
        path: Paths of all worlds, see `with_routes`.
        ways: Joints ``(k, n_arm)``, at least two, evenly along a path, by the number of the world.
    """
    if not ways:
        return path
    assert path.joints is not None
    (joints,) = (np.array(values, float) for values in fetched([path.joints]))
    rows = np.linspace(0.0, 1.0, joints.shape[1])
    for world, way in ways.items():
        places = np.linspace(0.0, 1.0, len(way))
        joints[world] = np.stack([np.interp(rows, places, column) for column in way.T], axis=-1)
    return path._replace(joints=constant(joints, path.table))


def hurried(ways: Mapping[int, Array], arm: Arm, pace: Pace) -> dict[int, list[Route]]:
    """The motions of those worlds in which joints would else have to go faster than they may.

    A simulated drive falls behind there and catches up; a real arm is stopped, since it is not where it was
    told to be.

    Args:
        ways: Joints ``(k, n_arm)``, at least two, evenly along a path, by the number of the world.
        arm: The arm.
        pace: How fast its tool goes.
    """
    return {k: [followed(arm, way, pace)] for k, way in ways.items() if hurries(arm, way, pace)}


def joints_along(path: Path, arm: Arm, starts: Mapping[int, Array]) -> dict[int, Array]:
    """Joints ``(k, n_arm)`` evenly along the paths of some worlds, of those that the arm can follow.

    Args:
        path: Paths of all worlds, with `SAMPLES` rows.
        arm: The arm.
        starts: Its joints ``(n_arm,)`` where a path begins, by the number of the world.
    """
    (tables,) = fetched([path.table])
    found = {k: arm.along(start, np.asarray(tables[k, ::EVERY], float)) for k, start in starts.items()}
    return {k: joints for k, joints in found.items() if joints is not None}


def _in_time(pieces: Sequence[Route], n: int, arm_joints: int) -> tuple[Array, Array, float]:
    """Tool poses ``(n, 7)`` and joints ``(n, n_arm)`` at even times, and the seconds in all."""
    ends = np.cumsum([piece.duration for piece in pieces])
    times = np.linspace(0.0, ends[-1], n)
    which = np.minimum(np.searchsorted(ends, times, side="left"), len(pieces) - 1)
    tools, joints = np.empty((n, 7)), np.full((n, arm_joints), np.nan)
    for k, piece in enumerate(pieces):
        rows = which == k
        began = float(ends[k]) - piece.duration
        place = minimum_jerk(np.clip((times[rows] - began) / piece.duration, 0.0, 1.0)) * (
            len(piece.tools) - 1
        )
        i = np.minimum(place.astype(int), len(piece.tools) - 2)
        f = place - i
        tools[rows] = poses.interpolate(piece.tools[i], piece.tools[i + 1], f)
        if piece.joints.shape[1]:
            joints[rows] = piece.joints[i] + f[:, None] * (piece.joints[i + 1] - piece.joints[i])
    return tools, joints, float(ends[-1])
