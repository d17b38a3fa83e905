"""Limits that no task may exceed, judged from what a robot can observe."""

from __future__ import annotations

from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.poses import Array, clip, norm, rotate
from bt_tasksim.core.units import NEWTONS

FAR = 0.5
"""Metres over the ground between the arm's base and its tool within which a hand meets things more slowly,
see `gentler`."""
FORCE_LIMIT = 60.0
"""N at the wrist: well above what carrying and placing take, well below what breaks a cup or a finger."""
PART_FORCE_LIMIT = 50.0
"""The same for parts of furniture: what a stiff drawer takes, and well below what tears a handle off."""
WRIST_STRAINED = register_reason(
    "wrist_strained", "force at the wrist is {value:.3g}, above {limit:.3g}", value=NEWTONS, limit=NEWTONS
)


def gentler(tool: Array) -> Array:
    """Share ``(N,)`` of the usual speed at which an arm should come upon things, from 0 to 1.

    It falls with the square of the distance over the ground between the arm's base and its tool, as the
    stiffness of the same drives grows. A jaw of the SO-100 that meets a ring at 50 mm/s, 0.27 m from its
    base, presses 115 N before it can be stopped.

    Args:
        tool: Tool poses ``(N, 7)``, robot base frame.
    """
    return clip(norm(tool[:, :2]) / FAR, 0.0, 1.0) ** 2


def strain(seen: Seen, limit: float) -> Limit:
    """The force at the wrist may be ``limit`` N: else the hand or the object presses against something."""
    return Limit(WRIST_STRAINED, force_at_wrist(seen), limit)


def force_at_wrist(seen: Seen) -> Array:
    """Magnitude ``(N,)`` of the force at the wrist, N."""
    return norm(seen.wrench[:, :3])


def force_at_tool(seen: Seen) -> Array:
    """Forces ``(N, 3)`` at the wrist in the robot base frame, N."""
    return rotate(seen.tool[:, 3:], seen.wrench[:, :3])


def torque_at_tool(seen: Seen) -> Array:
    """Torques ``(N, 3)`` at the wrist in the robot base frame, Nm."""
    return rotate(seen.tool[:, 3:], seen.wrench[:, 3:])


def longer_than_allowed(duration: float, timeout: float) -> str:
    """What is wrong where something should last longer than it may, both in seconds; else nothing."""
    if duration <= timeout:
        return ""
    return f"its 'timeout' of {timeout:g} s would end it before its {duration:g} s are over: raise that"
