"""Kinematics by Pinocchio: tool poses to joint targets, joint positions to link poses.

How joints are found for a pose stands in `bt_tasksim.robot.kinematics.inverse`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np
import pinocchio as pin

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Command, JointTarget, WorldState
from bt_tasksim.engines.base import EngineSetup, KinematicsEngine
from bt_tasksim.engines.kinematics.batch import BatchKinematics, with_posture
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.chain import turned
from bt_tasksim.robot.kinematics.failures import Failures
from bt_tasksim.robot.kinematics.models import arm_model, body_index, full_model, pose_of, se3
from bt_tasksim.robot.kinematics.rows import columns
from bt_tasksim.scene.configuration import ActorConfiguration

PATIENCE = 0.03
"""Seconds that a call of a real robot's inverse kinematics takes where a few iterations do not settle it."""


@register("engine/kinematics", "pinocchio")
class PinocchioKinematics(KinematicsEngine):
    """A `KinematicsEngine` for one arm with a hand, and forward and inverse kinematics for planners.

    `solve` tracks ``command.tool`` from one control step to the next: `BatchKinematics` of one world, without
    the leading axis.

    Args:
        robot: The robot.
        control_period: Seconds between two calls of `solve`, until `reset` says otherwise.
        patience: Seconds that a call takes which a few iterations do not settle, for real time: going on from
            the last posture has half of them, and a search for another one what is left. By default both go
            on to their end, and so do not depend on the machine's speed.

    Raises:
        InputError: The description does not fit its URDF.
    """

    def __init__(
        self, robot: RobotDescription, control_period: float = 0.05, patience: float = math.inf
    ) -> None:
        self.robot = robot
        self._n = len(robot.arm_joints)
        self._full, self._order = full_model(robot)
        self._full_data = self._full.createData()
        model = arm_model(robot, self._full)
        self.batch = BatchKinematics(robot, model, 1, control_period=control_period, patience=patience)

    @classmethod
    def create(cls, robot: RobotDescription, setup: EngineSetup) -> Self:
        """See `Engine.create`; a real robot does not wait for a long search."""
        return cls(robot, patience=PATIENCE if setup.real else math.inf)

    def reset(self, configuration: ActorConfiguration) -> None:
        """Prepare for an episode: forget the last targets."""
        self.batch.reset([0], [configuration])

    def solve(self, command: Command, state: WorldState) -> JointTarget:
        """Joint target that brings the tool to ``command.tool`` in one control period.

        Args:
            command: Tool pose ``(7,)`` and hand ``(1 + n_synergies,)``; a part is None where nothing was
                asked of it since the reset, and its joints stay where they began. With a posture ``(n_arm,)``
                the joints are those nearest to it.
            state: The present state; looked at on the first call after a reset only.

        Returns:
            Positions ``(n_joints,)`` and the velocities ``(n_joints,)`` that lead there from the last target.

        Raises:
            UnreachableError: No posture brings the tool there, or only one that the arm would have to swing
                to while the tool hardly moves; the target has not changed then.
        """
        parts = (command.tool, command.hand, command.posture)
        one = Command(*(None if part is None else np.asarray(part, float)[None] for part in parts))
        joints = np.asarray(state.joint_position, float)[None]
        target, failures = self.batch.track(with_posture(one), one.hand, joints)
        if failures:
            raise _error(failures)
        return JointTarget(target.position[0], target.velocity[0])

    def inverse(self, pose: Array, seed: Array | None = None, posture: Array | None = None) -> Array:
        """Joints ``(n_arm,)`` that bring the tool to a pose, in the posture nearest to the preferred one.

        Deterministic: begins at ``seed``, the rest posture, and then at fixed random postures.

        Args:
            pose: Tool pose ``(7,)``, robot base frame.
            seed: Joints ``(n_arm,)`` to begin at; by default the rest posture.
            posture: Joints ``(n_arm,)`` to come near to; by default the rest posture.

        Raises:
            UnreachableError: No posture brings the tool there; says by how much the nearest one misses.
        """
        asked = np.asarray(pose, float)[None]
        found, failures = self.batch.joints_at(
            asked, *(None if q is None else q[None] for q in (seed, posture))
        )
        if failures:
            raise _error(failures)
        return found[0]

    def joints_of_hand_start(self, start: tuple[float, ...]) -> tuple[float, ...]:
        """See `KinematicsEngine.joints_of_hand_start`."""
        arm = self.inverse(self.robot.pointing_down(np.array(start[:3]), start[3]))
        return tuple(np.concatenate([arm, self.robot.hand_open]).tolist())

    def forward(self, joints: Array) -> Array:
        """Tool poses ``(..., 7)``, robot base frame, of joints ``(..., n)``: the arm's, or all of them."""
        q = np.asarray(joints, float)
        return self.batch.tool_pose(q.reshape(-1, q.shape[-1])).reshape(*q.shape[:-1], 7)

    def tool_pose(self, state: WorldState) -> Array:
        """See `KinematicsEngine.tool_pose`."""
        return self.forward(state.joint_position)

    def jacobian(self, joints: Array, frame: str = "tool") -> Array:
        """Jacobian ``(..., 6, n_arm)`` of the tool origin: rows linear (m), then angular (rad).

        Args:
            joints: Joints ``(..., n)``: the arm's, or all (arm first).
            frame: Axes of the rows: ``tool`` or ``base``.
        """
        q = np.asarray(joints, float)[..., : self._n]
        chain = self.batch.inverse.chain
        seen = chain.seen(columns(q.reshape(-1, self._n)))
        out = chain.jacobian(seen)
        if frame != "tool":
            out = np.concatenate([turned(seen[0], out[:, :3]), turned(seen[0], out[:, 3:])], axis=1)
        return out.transpose(2, 1, 0).reshape(*q.shape[:-1], 6, self._n)

    def link_poses(self, joints: Array, links: Sequence[str] | None = None) -> Mapping[str, Array]:
        """Poses ``(7,)``, robot base frame, of links by name.

        Args:
            joints: All joints ``(n_joints,)`` in the robot's order.
            links: Names of the links; by default all.

        Raises:
            InputError: There is no such link.
        """
        model, data = self._full, self._full_data
        q = np.empty(model.nq)
        q[:] = pin.neutral(model)
        q[self._order] = joints
        pin.framesForwardKinematics(model, data, q)
        names = [f.name for f in model.frames if f.type == pin.FrameType.BODY] if links is None else links
        return {name: pose_of(data.oMf[body_index(model, name, self.robot)]) for name in names}

    def tips(self, joints: Array) -> Array:
        """Positions ``(n_tips, 3)`` of the fingertips, robot base frame, of all joints ``(n_joints,)``."""
        tips = self.robot.tips
        frames = self.link_poses(joints, [tip.links[0] for tip in tips])
        return np.array([se3(frames[tip.links[0]]).act(np.array(tip.point)) for tip in tips])


def _error(failures: Failures) -> InputError:
    error = failures.error(0)
    assert error is not None
    return error
