"""Turning what is held: poses on the way about an axis, and the arm's way through them, in one world."""

from __future__ import annotations

import itertools
import math

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.arm import LEANS
from bt_tasksim.planning.ways import WayFinder

STEP = 0.1
"""Radians between two poses on the way, at most."""
POSTURES = 4
"""Postures from which it is tried whether the arm can go on."""


def turned(pose: Array, axis: Array, point: Array, angle: float) -> Array:
    """A pose ``(7,)`` turned about the line through ``point (3,)`` along ``axis (3,)``, a unit vector."""
    turn = poses.from_rotation_vector(angle * axis)
    position = point + poses.rotate(turn, pose[:3] - point)
    return np.concatenate([position, poses.quat_multiply(turn, pose[3:])])


def steps(angle: float, most: float = STEP) -> Array:
    """Angles ``(n,)`` in even steps from 0, left out, to one, of either sign."""
    count = max(1, math.ceil(abs(angle) / most - 1e-9))
    found: Array = angle * np.arange(1, count + 1) / count
    return found


def swung(pose: Array, axis: Array, point: Array, angle: float, most: float = STEP) -> Array:
    """Poses ``(n, 7)`` on the way of a turn, see `turned`, the one where it begins left out."""
    return np.array([turned(pose, axis, point, float(by)) for by in steps(angle, most)])


def followed_from(finder: WayFinder, start: Array, tools: Array, leans: float = LEANS) -> Array | None:
    """Joints ``(n + 1, n_arm)`` through tool poses ``(n, 7)`` one after the other, those at the start first.

    Args:
        finder: What is around.
        start: Joints ``(n_arm,)`` before the first pose.
        tools: The poses.
        leans: Radians by which an arm of few joints may turn its tool from the last one.

    Returns:
        None where the arm cannot follow, or would touch something.
    """
    if np.any(finder.beyond(tools) > 0.0):
        return None
    joints = finder.arm.along(start, tools, leans)
    if joints is None:
        return None
    found: Array = np.concatenate([start[None], joints])
    return found if finder.clear(found) else None


def led(finder: WayFinder, tool: Array, onwards: Array, leans: float = LEANS) -> Array | None:
    """Joints ``(n + 1, n_arm)`` at a tool pose ``(7,)`` and through those ``(n, 7)`` behind it.

    Returns:
        None where no posture leads through them, clear of everything.
    """
    for start in itertools.islice(finder.postures(tool, leans), POSTURES):
        found = followed_from(finder, start, onwards, leans)
        if found is not None:
            return found
    return None
