"""The limits of a robot's file, section ``safety``.

Joint limits are those of the arm unless the section gives narrower ones. Each limit has a policy: ``stop``,
which is the default, or ``clip`` where slowing a motion down makes sense of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bt_tasksim.data_file import check_keys, positive, vector
from bt_tasksim.errors import InputError
from bt_tasksim.poses import Array

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

    def clips(self, limit: str) -> bool:
        """The limit's policy says clip."""
        return self.policies.get(limit, STOP) == CLIP


_JOINT = ("joint_position", "joint_velocity", "joint_acceleration", "step")
_KEYS: Mapping[str, tuple[str, ...]] = {
    "tool_velocity": ("linear", "angular"),
    "tool_acceleration": ("linear", "angular"),
    "workspace": ("lower", "upper"),
    "wrench": ("force", "torque"),
    "tracking": ("limit",),
}
_TIMES = {"stale": 0.1, "validity": 0.15, "watchdog": 0.15}


def read_limits(data: Any, arm: Mapping[str, Any]) -> SafetyLimits:
    """The limits in a robot file's section ``safety``.

    Args:
        data: The section.
        arm: The section ``arm``, whose limits are the widest that there may be.

    Raises:
        InputError: Something is missing, unknown, of the wrong size, wider than the arm's own limit, or a
            limit cannot have the policy that it is given.
    """
    optional = {**dict.fromkeys(_JOINT), "timing": None}
    check_keys(data, "safety.", dict.fromkeys(_KEYS), optional)
    policies = {}
    for name in (*_JOINT, *_KEYS):
        entry = data.get(name, {})
        keys = _KEYS.get(name) or (("lower", "upper") if name == "joint_position" else ("limit",))
        inner = dict.fromkeys(keys)
        needed, more = (inner, {}) if name in _KEYS else ({}, inner)
        check_keys(entry, f"safety.{name}.", needed, {**more, "policy": None})
        policies[name] = _policy(name, entry.get("policy", STOP))
    n = len(arm["joints"])
    arms = {key: vector(arm[key], n, f"arm.{key}") for key in ("lower", "upper", "velocity", "acceleration")}

    def joint(name: str, key: str, default: Array) -> Array:
        entry = data.get(name, {})
        return vector(entry[key], n, f"safety.{name}.{key}") if key in entry else default

    lower, upper = (joint("joint_position", key, arms[key]) for key in ("lower", "upper"))
    velocity = joint("joint_velocity", "limit", arms["velocity"])
    acceleration = joint("joint_acceleration", "limit", arms["acceleration"])
    _no_wider("joint_position.lower", arms["lower"], lower)
    _no_wider("joint_position.upper", upper, arms["upper"])
    _no_wider("joint_velocity.limit", velocity, arms["velocity"])
    _no_wider("joint_acceleration.limit", acceleration, arms["acceleration"])
    step = joint("step", "limit", 0.1 * velocity)
    if not np.all(lower < upper):
        raise InputError("safety.joint_position.lower is not below upper for every joint")
    for name, values in (("joint_velocity", velocity), ("joint_acceleration", acceleration), ("step", step)):
        if not np.all(values > 0.0):
            raise InputError(f"safety.{name}.limit should be positive for every joint")
    corners = [vector(data["workspace"][key], 3, f"safety.workspace.{key}") for key in ("lower", "upper")]
    box = np.array(corners)
    if not np.all(box[0] < box[1]):
        raise InputError("safety.workspace.lower is not below upper on every axis")
    return SafetyLimits(
        lower=lower,
        upper=upper,
        velocity=velocity,
        acceleration=acceleration,
        step=step,
        tool_speed=_one(data, "tool_velocity", "linear"),
        tool_turn=_one(data, "tool_velocity", "angular"),
        tool_acceleration=_one(data, "tool_acceleration", "linear"),
        tool_turn_acceleration=_one(data, "tool_acceleration", "angular"),
        workspace=box,
        force=_one(data, "wrench", "force"),
        torque=_one(data, "wrench", "torque"),
        tracking=_one(data, "tracking", "limit"),
        policies=policies,
        **_times(data.get("timing", {})),
    )


def _policy(name: str, value: Any) -> str:
    if value not in (STOP, CLIP):
        raise InputError(f"safety.{name}.policy should be 'stop' or 'clip', found {value!r}")
    if value == CLIP and name not in CLIPPING:
        raise InputError(f"safety.{name}.policy can only be 'stop'; {', '.join(CLIPPING)} may be 'clip'")
    return str(value)


def _no_wider(what: str, smaller: Array, larger: Array) -> None:
    if np.any(smaller > larger + 1e-9):
        i = int(np.argmax(smaller - larger))
        raise InputError(
            f"safety.{what} is wider than the arm's own limit for joint {i + 1} of {len(smaller)}, by "
            f"{float(smaller[i] - larger[i]):.3g}"
        )


def _one(data: Mapping[str, Any], name: str, key: str) -> float:
    return positive(data[name][key], f"safety.{name}.{key}")


def _times(data: Any) -> dict[str, float]:
    check_keys(data, "safety.timing.", {}, dict.fromkeys(_TIMES))
    times = {key: positive(data.get(key, value), f"safety.timing.{key}") for key, value in _TIMES.items()}
    for key, value in times.items():
        if value > REACTION - MARGIN:
            raise InputError(
                f"safety.timing.{key} should be at most {REACTION - MARGIN:g} s, found {value:g}: a robot "
                f"holds within {REACTION:g} s of a fault"
            )
    return times
