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


class WristSensor:
    """Reads an articulation's wrist.

    Args:
        articulation: The articulation.
        wrist: The link whose incoming joint is the wrist's.
        tool: The tool's pose ``(7,)`` now, in the frame in which links have theirs.
    """

    def __init__(
        self,
        articulation: physx.PhysxArticulation,
        wrist: physx.PhysxArticulationLinkComponent,
        tool: Array,
    ) -> None:
        self._articulation = articulation
        self._index = articulation.get_links().index(wrist)
        joint = next(j for j in articulation.get_joints() if j.child_link == wrist)
        frame = poses.multiply(array(wrist.entity_pose), array(joint.pose_in_child))
        in_joint = poses.multiply(poses.inverse(frame), tool)
        self._lever = in_joint[:3].tolist()
        self._to_tool = [0.0, 0.0, 0.0, *(in_joint[3:] * _CONJUGATE).tolist()]

    def wrench(self) -> Array:
        """External wrench ``(6,)`` at the tool, tool frame, from the wrist joint's incoming force.

        SAPIEN reports the force that the wrist's parent exerts on it in the joint's frame, which may be
        turned against the link's; at rest the world's force on the hand is its opposite. Moments are moved
        to the tool origin: t' = t - r x f.
        """
        x, y, z, u, v, w = self._articulation.get_link_incoming_joint_forces()[self._index].tolist()
        rx, ry, rz = self._lever
        moment = [ry * z - rz * y - u, rz * x - rx * z - v, rx * y - ry * x - w]
        frame = self._to_tool
        return np.array([*poses.point(frame, [-x, -y, -z]), *poses.point(frame, moment)])
