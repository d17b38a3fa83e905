"""Kinematics by Pinocchio: tool poses to joint targets, joint positions to link poses.

How joints are found for a pose stands in `bt_tasksim.engines.kinematics.inverse`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np
import pinocchio as pin

from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Command, JointTarget, WorldState
from bt_tasksim.engines.base import EngineSetup, KinematicsEngine
from bt_tasksim.engines.kinematics.inverse import InverseKinematics
from bt_tasksim.engines.kinematics.models import arm_model, body_index, full_model, se3
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

PATIENCE = 0.03
"""Seconds for which the inverse kinematics of a real robot looks for another posture."""
_LOCAL, _BASE = pin.ReferenceFrame.LOCAL, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_WXYZ = np.array([0, 1, 2, 6, 3, 4, 5])


@register("engine/kinematics", "pinocchio")
class PinocchioKinematics(KinematicsEngine):
    """A `KinematicsEngine` for one arm with a hand, and forward and inverse kinematics for planners.

    `solve` tracks ``command.tool`` from one control step to the next. It starts from its own last solution,
    never from the measured joints, so that a loaded arm does not drift. The joint target follows that
    solution as fast as the joints' velocity limits allow: a command that moves faster is caught up with
    later, all joints slowed by the same factor. Single, unbatched commands only.

    Args:
        robot: The robot.
        control_period: Seconds between two calls of `solve`, until `reset` says otherwise.
        patience: Seconds after which a search for another posture gives up, for real time; by default it goes
            on to its end, and so does not depend on the machine's speed.

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
        self._model = arm_model(robot, self._full)
        self._data = self._model.createData()
        self._frame = self._model.getFrameId("tool", pin.FrameType.OP_FRAME)
        self._inverse = InverseKinematics(robot, self._model, patience)
        self._set_period(control_period)
        self._restart()

    @classmethod
    def create(cls, robot: RobotDescription, setup: EngineSetup) -> Self:
        """See `Engine.create`; a real robot does not wait for a long search."""
        return cls(robot, patience=PATIENCE if setup.real else math.inf)

    def reset(self, configuration: ActorConfiguration) -> None:
        """Prepare for an episode: forget the last targets."""
        self._set_period(1.0 / configuration.control_frequency)
        self._restart()

    def _restart(self) -> None:
        self._target: Array | None = None
        self._goal: Array = np.empty(0)  # joints (n_joints,) that the target is on its way to
        self._tool_key = self._hand_key = b""
        self._still: JointTarget | None = None

    def _set_period(self, period: float) -> None:
        robot = self.robot
        hand = np.abs(robot.hand_closed - robot.hand_open)
        if len(robot.synergies):
            hand = np.maximum(hand, np.abs(robot.synergy_directions).max(axis=0))
        speed = np.concatenate([robot.arm_velocity, np.maximum(hand, 1e-9) * robot.hand_speed])
        self._period = period
        self._speeds = (1.0 / (speed * period)).tolist()

    def solve(self, command: Command, state: WorldState) -> JointTarget:
        """Joint target that brings the tool to ``command.tool`` in one control period.

        Args:
            command: Tool pose ``(7,)`` and hand ``(1 + n_synergies,)``; a part is None where nothing was
                asked of it since the reset, and its joints stay where they began.
            state: The present state; looked at on the first call after a reset only.

        Returns:
            Positions ``(n_joints,)`` and the velocities ``(n_joints,)`` that lead there from the last target.

        Raises:
            UnreachableError: No posture brings the tool there, or only one that the arm would have to swing
                to while the tool hardly moves; the target has not changed then.
        """
        if self._target is None:
            start = np.array(state.joint_position, float)
            robot = self.robot
            start[: self._n] = np.minimum(np.maximum(start[: self._n], robot.arm_lower), robot.arm_upper)
            low, high = robot.hand_range
            start[self._n :] = np.minimum(np.maximum(start[self._n :], low), high)  # encoders tremble
            self._target, self._goal = start, start
        tool, hand = command.tool, command.hand
        fresh = False
        if tool is not None and (key := tool.tobytes()) != self._tool_key:
            arm = self._inverse.near(se3(tool), self._goal[: self._n])
            goal = self._goal.copy()
            goal[: self._n] = arm
            self._goal, self._tool_key, fresh = goal, key, True
        if hand is not None and (key := hand.tobytes()) != self._hand_key:
            goal = self._goal.copy()
            goal[self._n :] = self.robot.hand_position(hand)
            self._goal, self._hand_key, fresh = goal, key, True
        if not fresh and self._still is not None:
            return self._still
        return self._follow()

    def _follow(self) -> JointTarget:
        """One period's way from the last target to the goal, within the velocity limits."""
        n = self._n
        assert self._target is not None
        step = self._goal - self._target
        share = [abs(x) * y for x, y in zip(step.tolist(), self._speeds, strict=True)]
        arm, hand = max(share[:n]), max(share[n:], default=0.0)
        if arm > 1.0 or hand > 1.0:
            step[:n] /= max(arm, 1.0)
            step[n:] /= max(hand, 1.0)
            self._target = self._target + step
        else:
            self._target = self._goal
        target = JointTarget(self._target, step / self._period)
        self._still = target if arm == 0.0 and hand == 0.0 else None
        return target

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
        starts = [] if seed is None else [np.asarray(seed, float)]
        return self._inverse.nearest(
            se3(pose), starts, None if posture is None else np.asarray(posture, float)
        )

    def joints_of_hand_start(self, start: tuple[float, ...]) -> tuple[float, ...]:
        """See `KinematicsEngine.joints_of_hand_start`."""
        arm = self.inverse(self.robot.pointing_down(np.array(start[:3]), start[3]))
        return tuple(np.concatenate([arm, self.robot.hand_open]).tolist())

    def forward(self, joints: Array) -> Array:
        """Tool poses ``(..., 7)``, robot base frame, of joints ``(..., n)``: the arm's, or all of them."""
        q = np.asarray(joints, float)[..., : self._n]
        out = np.empty((*q.shape[:-1], 7))
        rows = out.reshape(-1, 7)
        for i, row in enumerate(np.ascontiguousarray(q).reshape(-1, self._n)):
            pin.forwardKinematics(self._model, self._data, row)
            placement = pin.updateFramePlacement(self._model, self._data, self._frame)
            rows[i] = pin.SE3ToXYZQUAT(placement)[_WXYZ]
        return out

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
        out = np.empty((*q.shape[:-1], 6, self._n))
        rows = out.reshape(-1, 6, self._n)
        reference = _LOCAL if frame == "tool" else _BASE
        for i, row in enumerate(np.ascontiguousarray(q).reshape(-1, self._n)):
            rows[i] = pin.computeFrameJacobian(self._model, self._data, row, self._frame, reference)
        return out

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
        return {
            name: pin.SE3ToXYZQUAT(data.oMf[body_index(model, name, self.robot)])[_WXYZ] for name in names
        }

    def tips(self, joints: Array) -> Array:
        """Positions ``(n_tips, 3)`` of the fingertips, robot base frame, of all joints ``(n_joints,)``."""
        tips = self.robot.tips
        frames = self.link_poses(joints, [tip.links[0] for tip in tips])
        return np.array([se3(frames[tip.links[0]]).act(np.array(tip.point)) for tip in tips])
