"""Checks of what is sent to a robot and of what it reports: pure functions, one a limit.

Each returns None where all is well, or a `Breach` that names the limit, the place and the numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bt_tasksim import poses
from bt_tasksim.poses import Array
from bt_tasksim.safety.limits import SafetyLimits
from bt_tasksim.safety.motion import Motion

TOLERANCE = 1e-6
"""Share of a limit by which rounding may exceed it."""
JUMP = 0.05
"""Metres or radians that a measured joint may be off by noise and by rounding, besides its motion."""
IMPLAUSIBLE = 1.5
"""A measured joint does not move faster than so many times its limit."""


@dataclass(frozen=True)
class Breach:
    """A limit that would be, or is, exceeded.

    Attributes:
        limit: Its name, such as ``joint_velocity``.
        sentence: What, where and by how much.
    """

    limit: str
    sentence: str


def _over(limit: str, what: str, value: float, bound: float, unit: str) -> Breach:
    more = f"{value - bound:.3g} {unit} over its limit of {bound:.3g} {unit}"
    return Breach(limit, f"{limit.replace('_', ' ')}: {what} {value:.3g} {unit}, {more}")


def _worst(
    limit: str, what: str, values: Array, bounds: Array, names: Sequence[str], unit: str
) -> Breach | None:
    """The joint that exceeds its bound the most, relative to it."""
    excess = values - bounds * (1.0 + TOLERANCE)
    if not np.any(excess > 0.0):
        return None
    i = int(np.argmax(np.where(excess > 0.0, values / bounds, -np.inf)))
    return _over(limit, f"{names[i]} {what}", float(values[i]), float(bounds[i]), unit)


# ---- what is sent -----------------------------------------------------------------------------------------


def shape_and_numbers(position: Array, velocity: Array, names: Sequence[str]) -> Breach | None:
    """A command has one finite position and velocity a joint ``(n,)``."""
    for part, values in (("positions", position), ("velocities", velocity)):
        if np.shape(values) != (len(names),):
            found = f"{np.shape(values)} {part} commanded for {len(names)} joints"
            return Breach("joint_names", f"joint names: {found}")
        if not np.all(np.isfinite(values)):
            i = int(np.argmin(np.isfinite(values)))
            return Breach("not_finite", f"not finite: {part} commanded, {names[i]} at {values[i]}")
    return None


def joint_position(
    position: Array, lower: Array, upper: Array, names: Sequence[str], what: str = "would be at"
) -> Breach | None:
    """Joints ``(n,)`` are within their limits, rad or m."""
    over = np.maximum(position - upper, lower - position)
    i = int(np.argmax(over))
    if over[i] <= TOLERANCE:
        return None
    bound = float(upper[i] if position[i] > upper[i] else lower[i])
    found = f"{names[i]} {what} {float(position[i]):.4g} rad"
    return Breach(
        "joint_position",
        f"joint position: {found}, {float(over[i]):.2g} rad beyond its limit of {bound:.4g} rad",
    )


def joint_velocity(velocity: Array, limit: Array, names: Sequence[str]) -> Breach | None:
    """Joint speeds ``(n,)`` of the commanded motion, rad/s."""
    return _worst("joint_velocity", "would move at", np.abs(velocity), limit, names, "rad/s")


def joint_acceleration(
    before: Motion, after: Motion, limit: Array, period: float, names: Sequence[str]
) -> Breach | None:
    """Change of joint speeds ``(n,)`` between two periods, rad/s^2."""
    change = np.abs(after.velocity - before.velocity) / period
    return _worst("joint_acceleration", "would change speed by", change, limit, names, "rad/s^2")


def joint_step(before: Array, after: Array, limit: Array, names: Sequence[str]) -> Breach | None:
    """Step between successive commands ``(n,)``, rad."""
    return _worst("step", "would step by", np.abs(after - before), limit, names, "rad")


def twist(before: Array, after: Array, period: float) -> Array:
    """Mean linear (m/s) and angular (rad/s) velocity ``(6,)`` from one tool pose ``(7,)`` to another."""
    turn = poses.rotation_vector(poses.quat_multiply(after[3:], poses.quat_conjugate(before[3:])))
    return np.concatenate([after[:3] - before[:3], turn]) / period


def tool_velocity(twist: Array, limits: SafetyLimits) -> Breach | None:
    """Speed of the tool, of a twist ``(6,)``."""
    return _first_over(
        "tool_velocity",
        (
            ("the tool would move at", twist[:3], limits.tool_speed, "m/s"),
            ("the tool would turn at", twist[3:], limits.tool_turn, "rad/s"),
        ),
    )


def tool_acceleration(before: Array, after: Array, period: float, limits: SafetyLimits) -> Breach | None:
    """Change of the tool's speed between the twists ``(6,)`` of successive periods."""
    change = (after - before) / period
    return _first_over(
        "tool_acceleration",
        (
            ("the tool would change speed by", change[:3], limits.tool_acceleration, "m/s^2"),
            ("the tool would change its turning by", change[3:], limits.tool_turn_acceleration, "rad/s^2"),
        ),
    )


def _first_over(limit: str, parts: Sequence[tuple[str, Array, float, str]]) -> Breach | None:
    """The first vector that is longer than its bound."""
    for what, vector, bound, unit in parts:
        length = float(np.linalg.norm(vector))
        if length > bound * (1.0 + TOLERANCE):
            return _over(limit, what, length, bound, unit)
    return None


def workspace(position: Array, box: Array, what: str = "the tool would be") -> Breach | None:
    """The tool's origin ``(3,)`` is in the box ``(2, 3)``, metres."""
    over = np.maximum(box[0] - position, position - box[1])
    i = int(np.argmax(over))
    if over[i] <= TOLERANCE:
        return None
    x, y, z = position.tolist()
    excess = f"{1000 * float(over[i]):.0f} mm outside the box in {'xyz'[i]}"
    return Breach("workspace", f"workspace: {what} at ({x:.3f}, {y:.3f}, {z:.3f}) m, {excess}")


# ---- what is reported -------------------------------------------------------------------------------------


def joint_names(found: Sequence[str], expected: Sequence[str]) -> Breach | None:
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
    return Breach("joint_names", f"joint names: joint states {how}")


def reported_numbers(arrays: Sequence[Array], names: Sequence[str]) -> Breach | None:
    """Joint positions and velocities: one finite number a joint ``(n,)``."""
    for part, values in zip(("positions", "velocities"), arrays, strict=True):
        if np.shape(values) != (len(names),):
            found = f"{np.shape(values)} {part} reported for {len(names)} joints"
            return Breach("joint_names", f"joint names: {found}")
        if not np.all(np.isfinite(values)):
            i = int(np.argmin(np.isfinite(values)))
            return Breach("not_finite", f"not finite: {part} reported, {names[i]} at {values[i]}")
    return None


def fresh(age: float, limit: float) -> Breach | None:
    """Seconds since joint states were measured."""
    if age <= limit:
        return None
    return Breach(
        "stale", f"stale: joint states are {1000 * age:.0f} ms old, the limit is {1000 * limit:.0f} ms"
    )


def plausible(
    before: Array, after: Array, elapsed: float, velocity: Array, names: Sequence[str]
) -> Breach | None:
    """Measured joints ``(n,)`` moved no farther in the time between two reports than they can."""
    way = np.abs(after - before)
    can = IMPLAUSIBLE * velocity * max(elapsed, 0.0) + JUMP
    return _worst("implausible", "is reported to have jumped by", way, can, names, "rad")


def tracking(commanded: Array, measured: Array, limit: float, names: Sequence[str]) -> Breach | None:
    """Measured arm joints ``(n,)`` are where they were told to be, within a limit in rad."""
    off = np.abs(commanded - measured)
    return _worst("tracking", "is off its command by", off, np.full(len(off), limit), names, "rad")


def wrench(measured: Array, force: float, torque: float) -> Breach | None:
    """External wrench ``(6,)`` at the tool, N and Nm."""
    if not np.all(np.isfinite(measured)):
        return Breach("not_finite", "not finite: the wrist's wrench as reported")
    return _first_over(
        "wrench",
        (
            ("force on the tool", measured[:3], force, "N"),
            ("torque on the tool", measured[3:], torque, "Nm"),
        ),
    )
