"""What the wrist feels against the motion of a part of furniture along its joint."""

from __future__ import annotations

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.joint_conditions import value_of
from bt_tasksim.concept_nodes.limits import force_at_tool, torque_at_tool
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array


def reach_of(seen: Seen, target: str) -> Array:
    """Metres ``(N,)`` that the hand goes for a metre or a radian of a part, see `Joints.reach`."""
    return seen.model(target).joints.reach(value_of(seen, target), seen.tool[:, :3])


def distance_of(seen: Seen, target: str) -> Array:
    """Metres ``(N,)`` from a part's axis to the tool."""
    return poses.norm(seen.model(target).joints.arm(value_of(seen, target), seen.tool[:, :3]))


def force_against(seen: Seen, target: str, way: Array) -> Array:
    """Force ``(N,)`` at the wrist against the motion of a part, N, see `Joints.force`.

    Args:
        seen: What is seen.
        target: The part.
        way: Sign ``(N,)`` in which its value changes.
    """
    law, now, at = seen.model(target).joints, value_of(seen, target), seen.tool[:, :3]
    return -way * law.force(now, at, force_at_tool(seen), torque_at_tool(seen))
