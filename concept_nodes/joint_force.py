"""What the wrist feels against the motion of a part of furniture along its joint."""

from __future__ import annotations

import math

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.limits import force_at_tool, torque_at_tool
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace

ARM = 0.05
"""Metres from the axis at which, at least, a torque is taken as a force: knobs are held on their axis."""


def lever_of(seen: Seen, target: str) -> Array:
    """From a part's axis to the tool ``(N, 3)``, across the axis, robot base frame, metres."""
    at, axis = _axis(seen, target)
    lever = seen.tool[:, :3] - at
    return lever - poses.dot(lever, axis)[:, None] * axis


def arm_of(seen: Seen, target: str) -> Array:
    """Metres ``(N,)`` from a part's axis to the tool, and `ARM` at least."""
    return poses.clip(poses.norm(lever_of(seen, target)), ARM, math.inf)


def force_against(seen: Seen, target: str, way: Array) -> Array:
    """Force ``(N,)`` at the wrist against the motion of a part, N.

    Where the part turns, it is the torque about its axis over the hand's distance from that, see `arm_of`.

    Args:
        seen: What is seen.
        target: The part.
        way: Sign ``(N,)`` in which its value changes.
    """
    at, axis = _axis(seen, target)
    force = force_at_tool(seen)
    about = torque_at_tool(seen) + poses.cross(seen.tool[:, :3] - at, force)
    turning = poses.dot(about, axis) / arm_of(seen, target)
    turns = seen.model(target).joint_turns
    return -way * array_namespace(way).where(turns, turning, poses.dot(force, axis))


def _axis(seen: Seen, target: str) -> tuple[Array, Array]:
    """A point of a part's axis, and the axis ``(N, 3)``, robot base frame."""
    law = seen.model(target).joints
    now = law.pose(law.value(seen.object(target)))
    return poses.transform(now, law.origin), poses.rotate(now[:, 3:], law.axis)
