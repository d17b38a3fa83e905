"""From a world state and an estimate to an observation: force features and aligned visual ones."""

from __future__ import annotations

import numpy as np

from bt_tasksim import poses
from bt_tasksim.poses import Array
from bt_tasksim.robot import RobotDescription
from bt_tasksim.scene import ActorConfiguration
from bt_tasksim.shapes import nearest_point
from bt_tasksim.world import Observation, WorldState

TOUCH = 0.2
"""N on a fingertip that count as contact."""


class ObservationBuilder:
    """Builds observations, the same way whatever the estimate came from.

    Args:
        robot: The robot.
        configuration: The episode's world; of its objects only what perception knows is used: their shapes.
    """

    def __init__(self, robot: RobotDescription, configuration: ActorConfiguration) -> None:
        self._robot = robot
        self._n_arm = len(robot.arm_joints)
        self._limit = robot.hand_drive.force_limit
        self._shapes = [actor.shape() for actor in configuration.objects]
        self._before: tuple[int, Array, float] | None = None

    def build(self, state: WorldState, estimate: Array) -> Observation:
        """The observation for estimated object poses ``(n_objects, 7)``."""
        n = self._n_arm
        tips, tool = state.tips, state.tool_pose
        which = self._nearest(tool, estimate)
        if which < 0:
            points, motion = tips.copy(), np.zeros(6)
        else:
            pose = estimate[which]
            back = poses.inverse(pose)
            local = np.array([poses.transform(back, tip) for tip in tips])
            nearest = nearest_point(self._shapes[which], local)
            points = np.array([poses.transform(pose, p) for p in nearest])
            motion = self._motion(which, poses.multiply(poses.inverse(tool), pose), float(state.time))
        force = state.tip_force
        return Observation(
            time=state.time,
            arm_position=state.joint_position[:n],
            arm_velocity=state.joint_velocity[:n],
            hand_position=state.joint_position[n:],
            hand_effort=state.joint_effort[n:] / self._limit,
            closure=self._robot.closure(state.joint_position[n:]),
            tool_pose=tool,
            tips=tips,
            contacts=(force * force).sum(-1) > TOUCH * TOUCH,
            contact_force=force,
            wrench=state.wrench,
            objects=estimate,
            contact_points=points,
            motion=motion,
        )

    def _nearest(self, tool: Array, estimate: Array) -> int:
        if len(estimate) == 0:
            return -1
        if len(estimate) == 1:
            return 0
        gap = estimate[:, :3] - tool[:3]
        return int(np.argmin((gap * gap).sum(-1)))

    def _motion(self, which: int, relative: Array, time: float) -> Array:
        """Twist ``(6,)`` of the object relative to the tool, by a finite difference, tool frame."""
        before, self._before = self._before, (which, relative, time)
        if before is None or before[0] != which or time <= before[2]:
            return np.zeros(6)
        dt = time - before[2]
        turned = poses.quat_multiply(relative[3:], before[1][3:] * _CONJUGATE)
        return np.concatenate([relative[:3] - before[1][:3], poses.rotation_vector(turned)]) / dt


_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
