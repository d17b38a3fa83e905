"""Checks of what is sent to a robot and of what it reports: pure functions, one a limit.

Each returns None where all is well, or an outcome that says which limit is exceeded, where and by how much.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Outcome, Reason, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.units import METRES, MILLISECONDS, Unit
from bt_tasksim.hardware.safety.motion import JointMotion
from bt_tasksim.hardware.safety.stop import M_PER_S, M_PER_S2, NM, RAD, RAD_PER_S, RAD_PER_S2, M, N
from bt_tasksim.robot.limits import SafetyLimits

TOLERANCE = 1e-6
"""Share of a limit by which rounding may exceed it."""
JUMP = 0.05
"""Metres or radians that a measured joint may be off by noise and by rounding, besides its motion."""
FASTEST = 1.5
"""A measured joint does not move faster than so many times its limit."""


def _limit(name: str, template: str, unit: Unit) -> Reason:
    """A reason with a value, its limit, and the excess of the one over the other."""
    excess = "{value}, {excess} over its limit of {limit}"
    return register_reason(name, f"{template} {excess}", value=unit, excess=unit, limit=unit)


JOINT_POSITION = register_reason(
    "joint_position_limit",
    "joint position: {joint} {what} {value:.4g}, {excess:.2g} beyond its limit of {limit:.4g}",
    value=RAD,
    excess=RAD,
    limit=RAD,
)
JOINT_VELOCITY = _limit("joint_velocity_limit", "joint velocity: {joint} would move at", RAD_PER_S)
JOINT_ACCELERATION = _limit(
    "joint_acceleration_limit", "joint acceleration: {joint} would change speed by", RAD_PER_S2
)
JOINT_STEP = _limit("joint_step_limit", "step: {joint} would step by", RAD)
TOOL_SPEED = _limit("tool_speed_limit", "tool velocity: the tool would move at", M_PER_S)
TOOL_TURN = _limit("tool_turn_limit", "tool velocity: the tool would turn at", RAD_PER_S)
TOOL_ACCELERATION = _limit(
    "tool_acceleration_limit", "tool acceleration: the tool would change speed by", M_PER_S2
)
TOOL_TURN_ACCELERATION = _limit(
    "tool_turn_acceleration_limit", "tool acceleration: the tool would change its turning by", RAD_PER_S2
)
OUTSIDE_WORKSPACE = register_reason(
    "outside_workspace",
    "workspace: {what} at ({x:.3f}, {y:.3f}, {z:.3f}), {excess} outside the box in {axis}",
    x=M,
    y=M,
    z=M,
    excess=METRES,
)
WRONG_JOINTS = register_reason("wrong_joints", "joint names: {found}")
NOT_FINITE = register_reason("not_finite", "not finite: {what}")
STALE = register_reason(
    "stale_joint_states",
    "stale: joint states are {age} old, the limit is {limit}",
    age=MILLISECONDS,
    limit=MILLISECONDS,
)
IMPLAUSIBLE = _limit("implausible_joint_states", "implausible: {joint} is reported to have jumped by", RAD)
TRACKING = _limit("tracking_error", "tracking: {joint} is off its command by", RAD)
FORCE = _limit("force_limit", "wrench: force on the tool", N)
TORQUE = _limit("torque_limit", "wrench: torque on the tool", NM)


def _over(reason: Reason, value: float, bound: float, **names: str) -> Outcome:
    return reason(value=value, excess=value - bound, limit=bound, **names)


def _worst(reason: Reason, values: Array, bounds: Array, names: Sequence[str]) -> Outcome | None:
    """The joint that exceeds its bound the most, relative to it."""
    excess = values - bounds * (1.0 + TOLERANCE)
    if not np.any(excess > 0.0):
        return None
    i = int(np.argmax(np.where(excess > 0.0, values / bounds, -np.inf)))
    return _over(reason, float(values[i]), float(bounds[i]), joint=names[i])


# ---- what is sent -----------------------------------------------------------------------------------------


def shape_and_numbers(position: Array, velocity: Array, names: Sequence[str]) -> Outcome | None:
    """A command has one finite position and velocity a joint ``(n,)``."""
    return _one_finite_number_a_joint("commanded", (position, velocity), names)


def joint_position(
    position: Array, lower: Array, upper: Array, names: Sequence[str], what: str = "would be at"
) -> Outcome | None:
    """Joints ``(n,)`` are within their limits, rad or m."""
    over = np.maximum(position - upper, lower - position)
    i = int(np.argmax(over))
    if over[i] <= TOLERANCE:
        return None
    bound = float(upper[i] if position[i] > upper[i] else lower[i])
    return JOINT_POSITION(joint=names[i], what=what, value=position[i], excess=over[i], limit=bound)


def joint_velocity(velocity: Array, limit: Array, names: Sequence[str]) -> Outcome | None:
    """Joint speeds ``(n,)`` of the commanded motion, rad/s."""
    return _worst(JOINT_VELOCITY, np.abs(velocity), limit, names)


def joint_acceleration(
    before: JointMotion, after: JointMotion, limit: Array, period: float, names: Sequence[str]
) -> Outcome | None:
    """Change of joint speeds ``(n,)`` between two periods, rad/s^2."""
    change = np.abs(after.velocity - before.velocity) / period
    return _worst(JOINT_ACCELERATION, change, limit, names)


def joint_step(before: Array, after: Array, limit: Array, names: Sequence[str]) -> Outcome | None:
    """Step between successive commands ``(n,)``, rad."""
    return _worst(JOINT_STEP, np.abs(after - before), limit, names)


def twist(before: Array, after: Array, period: float) -> Array:
    """Mean linear (m/s) and angular (rad/s) velocity ``(6,)`` from one tool pose ``(7,)`` to another."""
    turn = poses.rotation_vector(poses.quat_multiply(after[3:], poses.quat_conjugate(before[3:])))
    return np.concatenate([after[:3] - before[:3], turn]) / period


def tool_velocity(twist: Array, limits: SafetyLimits) -> Outcome | None:
    """Speed of the tool, of a twist ``(6,)``."""
    return _longer(TOOL_SPEED, twist[:3], limits.tool_speed) or _longer(
        TOOL_TURN, twist[3:], limits.tool_turn
    )


def tool_acceleration(before: Array, after: Array, period: float, limits: SafetyLimits) -> Outcome | None:
    """Change of the tool's speed between the twists ``(6,)`` of successive periods."""
    change = (after - before) / period
    return _longer(TOOL_ACCELERATION, change[:3], limits.tool_acceleration) or _longer(
        TOOL_TURN_ACCELERATION, change[3:], limits.tool_turn_acceleration
    )


def _longer(reason: Reason, vector: Array, bound: float) -> Outcome | None:
    """A vector ``(3,)`` is longer than its bound."""
    length = float(np.linalg.norm(vector))
    return _over(reason, length, bound) if length > bound * (1.0 + TOLERANCE) else None


def workspace(position: Array, box: Array, what: str = "the tool would be") -> Outcome | None:
    """The tool's origin ``(3,)`` is in the box ``(2, 3)``, metres."""
    over = np.maximum(box[0] - position, position - box[1])
    i = int(np.argmax(over))
    if over[i] <= TOLERANCE:
        return None
    x, y, z = position.tolist()
    return OUTSIDE_WORKSPACE(what=what, x=x, y=y, z=z, excess=over[i], axis="xyz"[i])


# ---- what is reported -------------------------------------------------------------------------------------


def joint_names(found: Sequence[str], expected: Sequence[str]) -> Outcome | None:
    """Joint states name the robot's joints in their order."""
    if tuple(found) == tuple(expected):
        return None
    if sorted(found) == sorted(expected):
        i = next(i for i, (a, b) in enumerate(zip(found, expected, strict=True)) if a != b)
        how = f"are in another order, '{found[i]}' where '{expected[i]}' should be"
    elif missing := [name for name in expected if name not in found]:
        how = f"lack '{missing[0]}'"
    elif more := [name for name in found if name not in expected]:
        how = f"name '{more[0]}', which is no joint of the robot"
    else:
        how = "name a joint twice"
    return WRONG_JOINTS(found=f"joint states {how}")


def reported_numbers(arrays: Sequence[Array], names: Sequence[str]) -> Outcome | None:
    """Joint positions and velocities: one finite number a joint ``(n,)``."""
    return _one_finite_number_a_joint("reported", arrays, names)


def _one_finite_number_a_joint(how: str, arrays: Sequence[Array], names: Sequence[str]) -> Outcome | None:
    for part, values in zip(("positions", "velocities"), arrays, strict=True):
        if np.shape(values) != (len(names),):
            found = f"{np.shape(values)} {part} {how} for {len(names)} joints"
            return WRONG_JOINTS(found=found)
        if not np.all(np.isfinite(values)):
            i = int(np.argmin(np.isfinite(values)))
            return NOT_FINITE(what=f"{part} {how}, {names[i]} at {values[i]}")
    return None


def fresh(age: float, limit: float) -> Outcome | None:
    """Seconds since joint states were measured."""
    if age <= limit:
        return None
    return STALE(age=age, limit=limit)


def plausible(
    before: Array, after: Array, elapsed: float, velocity: Array, names: Sequence[str]
) -> Outcome | None:
    """Measured joints ``(n,)`` moved no farther in the time between two reports than they can."""
    way = np.abs(after - before)
    can = FASTEST * velocity * max(elapsed, 0.0) + JUMP
    return _worst(IMPLAUSIBLE, way, can, names)


def tracking(commanded: Array, measured: Array, limit: float, names: Sequence[str]) -> Outcome | None:
    """Measured arm joints ``(n,)`` are where they were told to be, within a limit in rad."""
    off = np.abs(commanded - measured)
    return _worst(TRACKING, off, np.full(len(off), limit), names)


def wrench(measured: Array, force: float, torque: float) -> Outcome | None:
    """External wrench ``(6,)`` at the tool, N and Nm."""
    if not np.all(np.isfinite(measured)):
        return NOT_FINITE(what="the wrist's wrench as reported")
    return _longer(FORCE, measured[:3], force) or _longer(TORQUE, measured[3:], torque)
