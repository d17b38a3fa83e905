"""The limits of a robot's file, section ``safety``.

Joint limits are those of the arm unless the section gives narrower ones. Each limit has a policy: ``stop``,
which is the default, or ``clip`` where slowing a motion down makes sense of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.core.errors import FieldError
from bt_tasksim.core.poses import Array

if TYPE_CHECKING:
    from bt_tasksim.robot.schema import ArmEntry, SafetyEntry

STOP, CLIP = "stop", "clip"
CLIPPING = ("joint_position", "joint_velocity", "joint_acceleration", "tool_acceleration")
"""Limits that may be clipped: the motion goes on, slower or less far. Beyond the others it makes no sense."""
REACTION = 0.25
"""Longest time in seconds from a fault until the arm holds."""
MARGIN = 0.05
"""Seconds of `REACTION` that are left for a process to wake up and for the message to arrive."""


@dataclass(frozen=True)
class SafetyLimits:
    """What a robot must never exceed.

    Attributes:
        lower: Lower position limits ``(n_arm,)``, rad.
        upper: Upper position limits ``(n_arm,)``, rad.
        velocity: ``(n_arm,)`` rad/s.
        acceleration: ``(n_arm,)`` rad/s^2; the arm also brakes with it.
        step: Largest joint step between successive commands ``(n_arm,)``, rad, however long that took.
        tool_speed: m/s, of the tool's origin.
        tool_turn: rad/s, of the tool frame.
        tool_acceleration: m/s^2.
        tool_turn_acceleration: rad/s^2.
        workspace: Lower and upper corner ``(2, 3)`` of the box that the tool's origin stays in, metres, base
            frame.
        force: External force on the tool, N.
        torque: External torque about the tool's origin, Nm.
        tracking: Largest difference of a commanded and a measured arm joint, rad.
        stale: Seconds after which joint states are too old to act on.
        validity: Seconds after which a command expires and the robot holds by itself.
        watchdog: Seconds without a sign of life from the runner after which the watchdog stops the robot.
        policies: ``stop`` or ``clip`` by the limit's name; what is not named is ``stop``.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    step: Array
    tool_speed: float
    tool_turn: float
    tool_acceleration: float
    tool_turn_acceleration: float
    workspace: Array
    force: float
    torque: float
    tracking: float
    stale: float
    validity: float
    watchdog: float
    policies: Mapping[str, str] = field(default_factory=dict)

    def in_workspace(self, points: Array) -> Array:
        """Booleans ``(...)``: the tool's origin may be at ``points (..., 3)``, metres, base frame."""
        low, high = self.workspace
        found: Array = ((points >= low) & (points <= high)).all(axis=-1)
        return found

    def clips(self, limit: str) -> bool:
        """The limit's policy says clip."""
        return self.policies.get(limit, STOP) == CLIP


_JOINT = ("joint_position", "joint_velocity", "joint_acceleration", "step")
_LIMITS = (*_JOINT, "tool_velocity", "tool_acceleration", "workspace", "wrench", "tracking")


def read_limits(data: SafetyEntry, arm: ArmEntry) -> SafetyLimits:
    """The limits in a robot file's section ``safety``.

    Args:
        data: The section.
        arm: The section ``arm``, whose limits are the widest that there may be.

    Raises:
        FieldError: Something is of the wrong size, wider than the arm's own limit, or a limit cannot have the
            policy that it is given.
    """
    policies = {name: _policy(name, getattr(data, name).policy) for name in _LIMITS}
    n = len(arm.joints)
    position = data.joint_position
    lower = _joints(position.lower, n, np.array(arm.lower), "joint_position", "lower")
    upper = _joints(position.upper, n, np.array(arm.upper), "joint_position", "upper")
    velocity = _joints(data.joint_velocity.limit, n, np.array(arm.velocity), "joint_velocity", "limit")
    acceleration = _joints(
        data.joint_acceleration.limit, n, np.array(arm.acceleration), "joint_acceleration", "limit"
    )
    _no_wider(np.array(arm.lower), lower, "joint_position", "lower")
    _no_wider(upper, np.array(arm.upper), "joint_position", "upper")
    _no_wider(velocity, np.array(arm.velocity), "joint_velocity", "limit")
    _no_wider(acceleration, np.array(arm.acceleration), "joint_acceleration", "limit")
    step = _joints(data.step.limit, n, 0.1 * velocity, "step", "limit")
    if not np.all(lower < upper):
        raise FieldError(
            "'safety.joint_position.lower' is not below 'upper' for every joint", "joint_position"
        )
    box = np.array([data.workspace.lower, data.workspace.upper])
    if not np.all(box[0] < box[1]):
        raise FieldError("'safety.workspace.lower' is not below 'upper' on every axis", "workspace")
    timing = data.timing
    for name in ("stale", "validity", "watchdog"):
        _soon_enough(name, getattr(timing, name))
    return SafetyLimits(
        lower=lower,
        upper=upper,
        velocity=velocity,
        acceleration=acceleration,
        step=step,
        tool_speed=data.tool_velocity.linear,
        tool_turn=data.tool_velocity.angular,
        tool_acceleration=data.tool_acceleration.linear,
        tool_turn_acceleration=data.tool_acceleration.angular,
        workspace=box,
        force=data.wrench.force,
        torque=data.wrench.torque,
        tracking=data.tracking.limit,
        stale=timing.stale,
        validity=timing.validity,
        watchdog=timing.watchdog,
        policies=policies,
    )


def _policy(name: str, value: str) -> str:
    if value == CLIP and name not in CLIPPING:
        raise FieldError(
            f"'safety.{name}.policy' can only be 'stop'; {', '.join(CLIPPING)} may be 'clip'", name, "policy"
        )
    return value


def _joints(given: Sequence[float] | None, n: int, default: Array, name: str, key: str) -> Array:
    """A limit of every joint ``(n,)``, not to be written to."""
    if given is not None and len(given) != n:
        raise FieldError(
            f"'safety.{name}.{key}' should be {n} numbers, one for each joint of the arm, found {len(given)}",
            name,
            key,
        )
    values = default if given is None else np.array(given)
    values.setflags(write=False)
    return values


def _no_wider(smaller: Array, larger: Array, name: str, key: str) -> None:
    if np.any(smaller > larger + 1e-9):
        i = int(np.argmax(smaller - larger))
        raise FieldError(
            f"'safety.{name}.{key}' is wider than the arm's own limit for joint {i + 1} of "
            f"{len(smaller)}, by {float(smaller[i] - larger[i]):.3g}",
            name,
            key,
        )


def _soon_enough(name: str, seconds: float) -> None:
    if seconds > REACTION - MARGIN:
        raise FieldError(
            f"'safety.timing.{name}' should be at most {REACTION - MARGIN:g} s, found {seconds:g}: a robot "
            f"holds within {REACTION:g} s of a fault",
            "timing",
            name,
        )
