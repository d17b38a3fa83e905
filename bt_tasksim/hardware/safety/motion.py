"""Commanded joint motion in discrete time: braking, and following a reference within limits.

Time is divided into control periods of T seconds. A motion is a position and the velocity that led there in
the last period, so the next position is q + T v with the next velocity v, which may differ from the last by
a T where a is the acceleration limit. All functions take arrays of joints ``(n,)``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bt_tasksim.core.poses import Array

RESERVE = 0.2
"""Share of the acceleration limits with which joints that lag may catch up."""
_SLACK = 1e-12


@dataclass(frozen=True, slots=True)
class JointMotion:
    """Where the joints were last told to be, and how fast they went there.

    Attributes:
        position: ``(n,)`` rad or m.
        velocity: ``(n,)`` rad/s or m/s, over the last period.
    """

    position: Array
    velocity: Array


def moved(before: JointMotion, position: Array, period: float) -> JointMotion:
    """The motion to a position ``(n,)`` within one period."""
    return JointMotion(position, (position - before.position) / period)


def stopping_speed(room: Array, acceleration: Array, period: float) -> Array:
    """Greatest speed ``(n,)`` of the next period from which joints come to stand within ``room (n,)``.

    With v the joints get v T + (v - a T) T + (v - 2 a T) T + ... as long as the terms are positive: at
    v = m a T that is a T^2 m (m + 1) / 2, between them it rises straight. This is its inverse.
    """
    endless = np.isinf(room)
    room = np.where(endless, 0.0, np.maximum(room, 0.0))
    unit = acceleration * period * period
    m = np.floor((np.sqrt(1.0 + 8.0 * room / unit) - 1.0) / 2.0)
    rest = room - np.where(m > 0.0, unit, 0.0) * m * (m + 1.0) / 2.0
    speed = np.where(m > 0.0, acceleration * period, 0.0) * m + rest / ((m + 1.0) * period)
    return np.where(endless, np.inf, speed)


def resting(motion: JointMotion, acceleration: Array, shortest: float) -> tuple[Array, float]:
    """Where joints come to stand ``(n,)`` that slow down evenly in the time of the slowest, and that time.

    This is the end of every command: what an engine sends, and what the guard looks at.

    Args:
        motion: The last motion; joints without a limit of acceleration stand at its position.
        acceleration: Limits ``(n,)``; infinite: none.
        shortest: Least time in seconds.
    """
    braking = max(float(np.max(np.abs(motion.velocity) / acceleration)), shortest)
    return motion.position + np.where(
        np.isfinite(acceleration), motion.velocity, 0.0
    ) * braking / 2.0, braking


def braked(before: JointMotion, acceleration: Array, period: float) -> JointMotion:
    """The next motion of joints that slow down as fast as they may."""
    slower = np.maximum(np.abs(before.velocity) - acceleration * period, 0.0)
    velocity = np.sign(before.velocity) * slower
    return JointMotion(before.position + period * velocity, velocity)


def followed(
    before: JointMotion,
    reference: JointMotion,
    velocity: Array,
    acceleration: Array,
    lower: Array,
    upper: Array,
    period: float,
) -> JointMotion:
    """The next motion of joints that follow a reference as closely as limits allow.

    Where the reference keeps the limits and the joints are on it, the result is the reference. Joints that
    have fallen behind catch up, all by the same share of what they lack, at a speed relative to the reference
    from which they can stop on it with `RESERVE` of their acceleration; the rest is for the reference's own.
    What is too fast a change of speed is made smaller by the same share for all joints, so that the tool
    keeps its direction. A joint never moves so fast that it could not come to stand before a position limit.

    Args:
        before: The last motion.
        reference: Where the joints should be at the period's end, and the reference's own velocity.
        velocity: Speed limits ``(n,)``; infinite: none.
        acceleration: Limits ``(n,)``; infinite: none.
        lower: Position limits ``(n,)``; infinite: none.
        upper: Position limits ``(n,)``; infinite: none.
        period: Seconds.
    """
    behind = reference.position - period * reference.velocity - before.position
    rate = _least_ratio(stopping_speed(np.abs(behind), RESERVE * acceleration, period), np.abs(behind))
    most = np.minimum(velocity, stopping_speed(upper - before.position, acceleration, period))
    least = -np.minimum(velocity, stopping_speed(before.position - lower, acceleration, period))
    wanted = reference.velocity + min(rate, 1.0 / period) * behind
    wanted = np.minimum(np.maximum(wanted, least), most)
    change = wanted - before.velocity
    share = min(_least_ratio(acceleration * period, np.abs(change)), 1.0)
    if share < 1.0:
        limited = np.isfinite(acceleration)
        wanted = np.where(limited, before.velocity + share * change, wanted)
        wanted = np.minimum(np.maximum(wanted, least), most)
    position = before.position + period * wanted
    near = np.abs(position - reference.position) <= _SLACK
    return JointMotion(np.where(near, reference.position, position), wanted)


def _least_ratio(a: Array, b: Array) -> float:
    """Smallest a / b of arrays ``(n,)``; infinite where b is zero."""
    some = b > _SLACK
    return float(np.min(a[some] / b[some], initial=np.inf))


def approach(
    start: Array, goal: Array, velocity: Array, acceleration: Array, period: float
) -> Iterator[JointMotion]:
    """The way from standing at ``start (n,)`` to standing at ``goal (n,)``, one motion a period.

    Args:
        start: Where the joints stand.
        goal: Where they shall stand.
        velocity: Speed limits ``(n,)``.
        acceleration: Limits ``(n,)``.
        period: Seconds.
    """
    motion, still = JointMotion(start, np.zeros_like(start)), JointMotion(goal, np.zeros_like(goal))
    endless = np.full_like(start, np.inf)
    while np.any(motion.position != goal) or np.any(motion.velocity):
        motion = followed(motion, still, velocity, acceleration, -endless, endless, period)
        yield motion
