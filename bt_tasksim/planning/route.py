"""A found way made into a motion: corners rounded, and as fast as joints and tool may go.

The time law is that of all motions here, minimum jerk over the way's length (`reference_motion`), slowed down
until no joint passes its limits of speed and acceleration. TOPP-RA and Ruckig would be faster by some tenths
of a second, and would begin and end with a jerk that is not bounded.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.arm import Arm
from bt_tasksim.planning.reference_motion import minimum_jerk

SAMPLES = 65
"""Rows of the table of a way that was searched for."""
_BLEND = 0.5
"""Radians before and after a corner within which it is rounded, at most."""
_SPEED, _ACCELERATION = 0.85, 0.4
"""Shares of the joints' limits that a way uses."""
_FINE = 200
_PEAK = 1.875
"""Peak speed of a minimum-jerk motion, over its mean one."""


class Pace(NamedTuple):
    """How fast the tool may go: m/s, rad/s, and m/s^2.

    An arm that lags behind by 0.1 s, as over a network, cuts the corners of a way by half the acceleration
    times that squared: with 0.8 m/s^2 by 4 mm, which is less than what is kept clear.
    """

    speed: float
    turn: float = 1.5
    acceleration: float = 0.8


class Route(NamedTuple):
    """A motion of one arm.

    Attributes:
        tools: Tool poses ``(n, 7)`` at equal steps of the way's own parameter.
        joints: The arm's joints ``(n, n_arm)`` there; ``(n, 0)`` where they may be any.
        duration: Seconds.
    """

    tools: Array
    joints: Array
    duration: float


def timed(arm: Arm, way: Sequence[Array], pace: Pace, free: Callable[[Array], bool] | None) -> Route:
    """The motion along straight lines between postures.

    Args:
        arm: The arm.
        way: Postures ``(n_arm,)``, two at least.
        pace: How fast the tool may go.
        free: Whether a posture is allowed; asked about corners that are cut. None: no corner is.
    """
    line = _dense(list(way) if free is None else _rounded(list(way), free))
    tools = arm.tools(line)
    along = np.concatenate([[0.0], np.cumsum(_seconds(arm, line, tools, pace))])
    shares = np.linspace(0.0, max(float(along[-1]), 1e-9), SAMPLES)
    joints = _at(shares, along, line)
    duration = max(0.3, _PEAK * float(along[-1]))
    tools = arm.tools(joints)
    duration *= math.sqrt(max(1.0, _strain(arm, joints, tools, duration, pace)))
    return Route(tools, joints, duration)


def followed(arm: Arm, joints: Array, pace: Pace) -> Route:
    """The motion through postures ``(n, n_arm)`` close together, such as those along a straight line.

    Args:
        arm: The arm.
        joints: The postures, the one where it begins included.
        pace: How fast the tool may go.
    """
    return timed(arm, list(joints), pace, None)


def hurries(arm: Arm, joints: Array, pace: Pace) -> bool:
    """Whether a joint has to go faster than it may somewhere, where the tool goes as fast as it may.

    Args:
        arm: The arm.
        joints: Postures ``(n, n_arm)`` close together.
        pace: How fast the tool may go.
    """
    tools = arm.tools(joints)
    moved = np.linalg.norm(np.diff(tools[:, :3], axis=0), axis=-1) / pace.speed
    turned = poses.angle_between(tools[:-1, 3:], tools[1:, 3:]) / pace.turn
    needed = np.abs(np.diff(joints, axis=0) / (_SPEED * arm.robot.arm_velocity)).max(axis=-1)
    return bool((needed > np.maximum(moved, turned)).any())


def _at(shares: Array, along: Array, line: Array) -> Array:
    return np.stack([np.interp(shares, along, line[:, i]) for i in range(line.shape[1])], axis=-1)


def _seconds(arm: Arm, line: Array, tools: Array, pace: Pace) -> Array:
    """About how many seconds ``(n - 1,)`` each piece takes at full speed; smooth where the way is."""
    joints = np.diff(line, axis=0) / (_SPEED * arm.robot.arm_velocity)
    moved = np.linalg.norm(np.diff(tools[:, :3], axis=0), axis=-1) / pace.speed
    turned = poses.angle_between(tools[:-1, 3:], tools[1:, 3:]) / pace.turn
    found: Array = (np.abs(joints).max(axis=-1) ** 4 + moved**4 + turned**4) ** 0.25
    return found


def _strain(arm: Arm, joints: Array, tools: Array, duration: float, pace: Pace) -> float:
    """The largest acceleration of a joint or of the tool, over its limit."""
    n = len(joints)
    f = np.linspace(0.02, 0.98, 50)
    s, ds, dds = minimum_jerk(f), 30 * f**2 * (1 - f) ** 2, 60 * f * (1 - f) * (1 - 2 * f)
    points = np.concatenate([joints, tools[:, :3]], axis=-1)
    first = np.gradient(points, 1.0 / (n - 1), axis=0)
    second = np.gradient(first, 1.0 / (n - 1), axis=0)
    grid = np.linspace(0.0, 1.0, n)
    first, second = _at(s, grid, first), _at(s, grid, second)
    hard = np.abs(first * dds[:, None] + second * ds[:, None] ** 2) / duration**2
    limit = _ACCELERATION * arm.robot.arm_acceleration
    return float(
        max((hard[:, :-3] / limit).max(), (np.linalg.norm(hard[:, -3:], axis=-1)).max() / pace.acceleration)
    )


def _rounded(way: list[Array], free: Callable[[Array], bool]) -> list[Array]:
    """The way with its corners replaced by parabolas, where these are allowed."""
    if len(way) < 3:
        return way
    out = [way[0]]
    for before, corner, after in zip(way, way[1:], way[2:], strict=False):
        out += _corner(before, corner, after, free)
    return [*out, way[-1]]


def _corner(before: Array, corner: Array, after: Array, free: Callable[[Array], bool]) -> list[Array]:
    lengths = [float(np.linalg.norm(other - corner)) for other in (before, after)]
    blend = min(_BLEND, *(0.5 * length for length in lengths))
    for _ in range(4):
        a, b = (
            corner + (other - corner) * (blend / max(length, 1e-9))
            for other, length in zip((before, after), lengths, strict=True)
        )
        t = np.linspace(0.0, 1.0, 9)[:, None]
        curve = (1 - t) ** 2 * a + 2 * t * (1 - t) * corner + t**2 * b
        if all(free(q) for q in curve[1:-1]):
            return list(curve)
        blend /= 2
    return [corner]


def _dense(way: list[Array]) -> Array:
    """Points on the way, ``_FINE`` and its corners, so that the tool's way between two is a line."""
    line = np.array(way)
    steps = np.abs(np.diff(line, axis=0)).max(axis=-1)
    along = np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1e-9))])
    shares = np.unique(np.concatenate([along, np.linspace(0.0, along[-1], _FINE)]))
    return _at(shares, along, line)
