"""Turning what is held: poses on the way about an axis, and how the arm comes along them, in one world."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.planning.arm import LEANS
from bt_tasksim.planning.route import Pace, Route
from bt_tasksim.planning.ways import WayFinder

STEP = 0.1
"""Radians between two poses on the way, at most."""
FINE, JUMP = 0.08, 0.3
"""Radians between two postures of a motion of the elbow, and by which no joint may turn more there."""
POSTURES = 4
"""Postures from which it is tried whether the arm can go on."""
ENOUGH = 6
"""Postures at ends among which a search chooses, see `brought`."""


def turned(pose: Array, axis: Array, point: Array, angle: float) -> Array:
    """A pose ``(7,)`` turned about the line through ``point (3,)`` along ``axis (3,)``, a unit vector."""
    return turned_by(pose, angle * axis, point)


def turned_by(pose: Array, turn: Array, point: Array) -> Array:
    """Poses ``(..., 7)`` turned about points ``(..., 3)`` by rotation vectors ``(..., 3)``, radians."""
    by = poses.from_rotation_vector(turn)
    position = point + poses.rotate(by, pose[..., :3] - point)
    rotation = poses.quat_multiply(by, pose[..., 3:])
    return array_namespace(pose).concat([position, rotation], axis=-1)


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


def followed_anyhow(finder: WayFinder, tools: Array, leans: float = LEANS) -> Array | None:
    """Joints ``(n, n_arm)`` from where the arm is through tool poses ``(k, 7)``, as `followed_from`.

    Where the arm cannot follow in its present posture, it first takes another one while its tool stays.
    """
    found = followed_from(finder, finder.start, tools, leans)
    if found is not None:
        return found
    now = finder.arm.tool(finder.start)
    other = led(finder, now, tools, leans)
    if other is None:
        return None
    moved = elbow_moved(finder, other[0], now)
    return None if moved is None else np.concatenate([moved, other[1:]])


def brought(finder: WayFinder, tools: Iterable[Array], pace: Pace) -> tuple[Route, int] | None:
    """A motion to one of some tool poses ``(7,)``, of the first `ENOUGH` of them that the arm can be at.

    Returns:
        The motion, and which of the poses it ends at; None where the arm can be at none.
    """
    goals: list[Array] = []
    kept: list[int] = []
    for k, tool in enumerate(tools):
        joints = next(finder.postures(tool), None)
        if joints is not None:
            goals.append(joints)
            kept.append(k)
        if len(goals) == ENOUGH:
            break
    if not goals:
        return None
    route = finder.search_posture(np.array(goals), pace)
    off = [float(np.abs(joints - route.joints[-1]).max()) for joints in goals]
    return route, kept[int(np.argmin(off))]


def elbow_moved(finder: WayFinder, end: Array, tool: Array) -> Array | None:
    """Joints ``(n, n_arm)`` from where the arm is to a posture ``(n_arm,)`` at the same tool pose ``(7,)``.

    Returns:
        None where the arm has no way to move between them with its tool at rest, clear of everything.
    """
    way = end - finder.start
    count = max(2, math.ceil(float(np.abs(way).max()) / FINE))
    found = [finder.start]
    for share in np.arange(1, count + 1) / count:
        joints = finder.arm.joints(tool, finder.start + share * way)
        if joints is None or float(np.abs(joints - found[-1]).max()) > JUMP:
            return None
        found.append(joints)
    if float(np.abs(found[-1] - end).max()) > JUMP:
        return None
    postures = np.array([*found, end])
    return postures if finder.clear(postures) else None
