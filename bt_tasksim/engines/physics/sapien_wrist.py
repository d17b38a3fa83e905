"""The wrist's force sensor in SAPIEN: what the world exerts on the hand, at the tool."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.sapien_world import array

if TYPE_CHECKING:
    from sapien import physx

_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


def wrist_frame(
    articulation: physx.PhysxArticulation, wrist: physx.PhysxArticulationLinkComponent, tool: Array
) -> tuple[Array, Array]:
    """Where the tool is in the frame of the wrist's joint.

    Args:
        articulation: The articulation.
        wrist: The link whose incoming joint is the wrist's.
        tool: The tool's pose ``(7,)`` now, in the frame in which links have theirs.

    Returns:
        Its position ``(3,)`` in that frame, and the rotation ``(4,)`` from that frame into the tool's.
    """
    joint = next(j for j in articulation.get_joints() if j.child_link == wrist)
    frame = poses.multiply(array(wrist.entity_pose), array(joint.pose_in_child))
    in_joint = poses.multiply(poses.inverse(frame), tool)
    return in_joint[:3], in_joint[3:] * _CONJUGATE


def external_wrench(incoming: Array, lever: Array, to_tool: Array) -> Array:
    """External wrenches ``(k, 6)`` at the tool, tool frame, from the wrist joint's incoming ones ``(k, 6)``.

    SAPIEN reports the force that the wrist's parent exerts on it in the joint's frame, which may be
    turned against the link's; at rest the world's force on the hand is its opposite. Moments are moved
    to the tool origin: t' = t - r x f.

    Args:
        incoming: Forces and torques.
        lever: See `wrist_frame`, ``(k, 3)``.
        to_tool: See `wrist_frame`, ``(k, 1, 4)``.
    """
    force, moment = incoming[:, :3], poses.cross(lever, incoming[:, :3]) - incoming[:, 3:]
    return poses.rotate(to_tool, np.stack([-force, moment], axis=1)).reshape(-1, 6)
