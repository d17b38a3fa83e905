"""The way of a hand to where it comes straight on to a grasp, and when it does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bt_tasksim.concept.seen import Seen
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.planning.reference_motion import Path, minimum_jerk_time, plan
from bt_tasksim.planning.route import Route
from bt_tasksim.planning.routes import SAMPLES

ACCELERATION = 3.0
"""Peak acceleration of the tool on the way to the grasp, m/s^2. It matters where the way is short, as for a
second grasp beside the first one: an arm that is hurried comes to the object beside its path."""
LAG = 0.1
"""Seconds by which an arm may be behind its targets: the delays of a robot's cell together, see
`bt_tasksim.hardware.twin.gap`. In a simulation there is next to none."""
SWAY = 0.012
"""Metres by which it may be aside of them when the straight approach begins."""


def approach_begins(path: Path, standoff: Array) -> Array:
    """Seconds ``(N,)`` after which no more than ``standoff (N,)`` metres are left of a path."""
    xp, n = array_namespace(path.table), path.table.shape[1]
    left = poses.norm(path.table[:, :, :3] - path.table[:, -1:, :3])
    numbers = xp.astype(xp.arange(1, n + 1, device=left.device), left.dtype)
    fraction = xp.max(xp.astype(left > standoff[:, None], left.dtype) * numbers, axis=-1) / (n - 1)
    share = minimum_jerk_time(fraction)
    return (share if path.even is None else xp.where(path.even, fraction, share)) * path.duration


def sways(way: Sequence[Array], goal: Array, speed: float) -> bool:
    """Whether a hand that does not stop before the straight approach would still sway aside on it.

    An arm lags behind its targets by `LAG`; what it lags aside by at the corner it has to make up for while
    it goes down beside the object.

    Args:
        way: Tool poses ``(7,)`` to where the approach begins.
        goal: The grasp ``(7,)``.
        speed: Peak speed of the tool, m/s.
    """
    corner, approach = way[-1], poses.z_axis(goal[3:])
    before = next((p for p in reversed(way[:-1]) if np.linalg.norm(p[:3] - corner[:3]) > 1e-3), None)
    if before is None:
        return False
    along = (corner[:3] - before[:3]) / np.linalg.norm(corner[:3] - before[:3])
    aside = float(np.linalg.norm(along - approach * float(along @ approach)))
    points = np.array([p[:3] for p in (*way, goal)])
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    done = np.array(1.0 - lengths[-1] / max(float(lengths.sum()), 1e-9))
    fraction = float(minimum_jerk_time(done[None])[0])
    there = 16.0 * fraction**2 * (1.0 - fraction) ** 2 * speed
    return there * aside * LAG > SWAY


def at_rest(way: Sequence[Array], speed: float, acceleration: float = ACCELERATION) -> list[Route]:
    """Motions of the tool through poses ``(k, 7)``, one each, from rest to rest, in whatever posture."""
    path = plan(way, speed, blend=0.03, acceleration=acceleration, samples=SAMPLES)
    any_posture = np.full((SAMPLES, 0), np.nan)
    return [
        Route(table, any_posture, float(duration))
        for table, duration in zip(path.table, path.duration, strict=True)
    ]


def way_out(seen: Seen, goal: Array) -> list[Array]:
    """Waypoints from the present tool pose that keep the hand above what stands around."""
    start = seen.tool
    xp = array_namespace(start)
    level = xp.maximum(start[:, 2], goal[:, 2])
    far = poses.norm(start[:, :2] - goal[:, :2]) > 0.05
    low = (start[:, 2] < level - 0.02) & far & (level < 0.35)
    rise = xp.where(low, level - start[:, 2], xp.zeros_like(level))
    return [start, poses.shifted(start, rise[:, None] * constant([0.0, 0.0, 1.0], start))]
