"""Kinematics by Pinocchio: tool poses to joint targets, joint positions to link poses.

The inverse kinematics is a Levenberg-Marquardt iteration with a damping that follows the remaining error
(T. Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", IEEE Trans.
Robotics 27(5), 2011; its ancestor: Y. Nakamura and H. Hanafusa, "Inverse kinematic solutions with singularity
robustness for robot manipulator control", J. Dyn. Sys. Meas. Control 108(3), 1986). The posture preference
acts in the null space of the tool's motion (A. Liegeois, IEEE Trans. SMC 7(12), 1977). Joints that would pass
a limit are set on it and the others make up for them (F. Flacco, A. De Luca, O. Khatib, "Motion control of
redundant robots under joint constraints: saturation in the null space", ICRA 2012).
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import eigenpy
import numpy as np
import pinocchio as pin

from bt_tasksim.engines.pinocchio_models import arm_model, body_index, full_model, se3
from bt_tasksim.errors import UnreachableError
from bt_tasksim.poses import Array
from bt_tasksim.robot import RobotDescription
from bt_tasksim.world import Command, JointTarget, WorldState

if TYPE_CHECKING:
    from bt_tasksim.scene import ActorConfiguration

_TOLERANCE = 5e-5
"""Largest component of the remaining error, m and rad, of a pose that counts as solved exactly."""
_MISS = (1e-3, 5e-3)
"""A nearest pose that misses by no more (m, rad) counts as reached; arms are not more accurate."""
_LENGTH = 0.3
"""Metres that weigh as much as one radian where position and rotation cannot both be had."""
_DAMPING = 1e-7
_TRACK, _HARDER, _SETTLE = 6, 200, 60
"""Iterations of a tracking step, of a solve that tries hard, and of settling into the preferred posture."""
_PULL = 0.2
"""Share of the way to the preferred posture that one tracking step asks of the null space."""
_PULL_LIMIT = 0.05
"""Largest such step of any joint, rad."""
_SWING, _SWING_PER_METRE, _SWING_PER_RADIAN = 0.5, 10.0, 2.0
"""A tracked arm may change its posture at once by so much: rad, and more for the way that the tool goes."""
_RESTARTS = 24
_LOCAL, _BASE = pin.ReferenceFrame.LOCAL, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_WXYZ = np.array([0, 1, 2, 6, 3, 4, 5])


class PinocchioKinematics:
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
        self._patience = patience
        self._n = len(robot.arm_joints)
        self._full, self._order = full_model(robot)
        self._full_data = self._full.createData()
        self._model = arm_model(robot, self._full)
        self._data = self._model.createData()
        self._frame = self._model.getFrameId("tool", pin.FrameType.OP_FRAME)
        self._full_frame = self._full.getFrameId("tool", pin.FrameType.OP_FRAME)
        self._lower, self._upper, self._rest = robot.arm_lower, robot.arm_upper, robot.rest
        self._limits = (self._lower.tolist(), self._upper.tolist())
        self._pull = _PULL * robot.posture
        self._rows = np.flatnonzero(robot.task_mask > 0.0)
        self._masked = len(self._rows) < 6
        self._weights = (robot.task_mask * ([1.0] * 3 + [_LENGTH] * 3))[self._rows]
        self._column = self._weights[:, None]
        self._eye = np.eye(len(self._rows))
        rng = np.random.default_rng(0)
        self._starts = rng.uniform(self._lower, self._upper, (_RESTARTS, self._n))
        self._period = control_period
        self._set_period(control_period)
        self._restart()

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

        A part of the command that is None, or the same as before, keeps its joints where they were to be.

        Args:
            command: Tool pose ``(7,)`` and hand ``(1 + n_synergies,)``, either may be None.
            state: The present state; looked at on the first call after a reset only.

        Returns:
            Positions ``(n_joints,)`` and the velocities ``(n_joints,)`` that lead there from the last target.

        Raises:
            UnreachableError: No posture brings the tool there, or only one that the arm would have to swing
                to while the tool hardly moves; the target has not changed then.
        """
        if self._target is None:
            start = np.array(state.joint_position, float)
            start[: self._n] = np.minimum(np.maximum(start[: self._n], self._lower), self._upper)
            low, high = self.robot.hand_range
            start[self._n :] = np.minimum(np.maximum(start[self._n :], low), high)  # encoders tremble
            self._target, self._goal = start, start
        tool, hand = command.tool, command.hand
        fresh = False
        if tool is not None and (key := tool.tobytes()) != self._tool_key:
            arm = self._track(tool)
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

    def _track(self, tool: Array) -> Array:
        """Joints ``(n_arm,)`` for the tool pose, continuous with the last solution where that is possible."""
        pose = se3(tool)
        last = self._goal[: self._n]
        pull = self._pull * (self._rest - last)
        largest = _largest(pull)
        if largest > _PULL_LIMIT:
            pull *= _PULL_LIMIT / largest
        q, error = self._iterate(last, pose, _TRACK, pull)
        if error <= _TOLERANCE:
            return q
        q, error = self._iterate(last, pose, _HARDER)
        missed = None if error <= _TOLERANCE else self._missed(q, pose)
        if missed is None:
            return q
        way = self._error(last, pose)
        metres, radians = float(np.linalg.norm(way[:3])), float(np.linalg.norm(way[3:]))
        swing = _SWING + _SWING_PER_METRE * metres + _SWING_PER_RADIAN * radians
        other = self._search(pose, [self._rest], last, best=q)
        if float(np.abs(other - last).max()) > swing:
            raise _unreachable(self.robot.name, pose, *missed, "without swinging into another posture")
        return other

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
        starts = [self._rest] if seed is None else [np.asarray(seed, float), self._rest]
        return self._search(se3(pose), starts, self._rest if posture is None else np.asarray(posture, float))

    def joints_of_hand_start(self, start: tuple[float, ...]) -> tuple[float, ...]:
        """All joints ``(n_joints,)`` with the hand open where an `ActorConfiguration` lets it begin.

        Args:
            start: Position (m) and turn (rad) ``(4,)``.

        Raises:
            UnreachableError: No posture brings the tool there.
        """
        arm = self.inverse(self.robot.pointing_down(np.array(start[:3]), start[3]))
        return tuple(np.concatenate([arm, self.robot.hand_open]).tolist())

    def _search(self, pose: Any, starts: Sequence[Array], posture: Array, best: Array | None = None) -> Array:
        """The solution nearest to a posture from given starts, or else from one of the random ones."""
        found: list[Array] = []
        tries = [np.minimum(np.maximum(start, self._lower), self._upper) for start in starts]
        nearest_miss = np.inf if best is None else self._cost(best, pose)
        began = time.monotonic()
        for i, start in enumerate([*tries, *self._starts]):
            if i >= len(tries) and (found or time.monotonic() - began > self._patience):
                break
            q, error = self._iterate(start, pose, _HARDER)
            cost = self._cost(q, pose)
            if cost < nearest_miss:
                best, nearest_miss = q, cost
            if error <= _TOLERANCE or self._missed(q, pose) is None:
                found.append(self._settle(q, pose, posture))
        if found:
            return min(found, key=lambda q: float(np.sum((q - posture) ** 2)))
        assert best is not None
        missed = self._missed(best, pose)
        assert missed is not None
        raise _unreachable(self.robot.name, pose, *missed)

    def _settle(self, q: Array, pose: Any, posture: Array) -> Array:
        """Moves a solution in its null space towards a posture, for as long as the tool stays in place."""
        for _ in range(_SETTLE):
            moved, error = self._iterate(q, pose, _TRACK, 0.3 * (posture - q))
            if error > _TOLERANCE or np.sum((moved - posture) ** 2) > np.sum((q - posture) ** 2):
                break
            far = float(np.abs(moved - q).max())
            q = moved
            if far < 1e-4:
                break
        return q

    def _iterate(
        self, q: Array, pose: Any, iterations: int, pull: Array | None = None
    ) -> tuple[Array, float]:
        """Levenberg-Marquardt from ``q (n_arm,)``; ``pull`` is a step asked of the null space at the start.

        Returns:
            The joints, within their limits, and the largest component of the remaining error (m, rad).
        """
        model, data, frame = self._model, self._data, self._frame
        lower, upper, column = self._limits[0], self._limits[1], self._column
        worst = np.inf
        for k in range(iterations + 1):
            pin.forwardKinematics(model, data, q)
            miss = pin.updateFramePlacement(model, data, frame).actInv(pose)
            e = np.concatenate((miss.translation, pin.log3(miss.rotation)))
            if self._masked:
                e = e[self._rows]
            worst = _largest(e)
            if (worst <= _TOLERANCE and pull is None) or k == iterations:
                break
            pin.computeJointJacobians(model, data)
            J = pin.getFrameJacobian(model, data, frame, _LOCAL)
            if self._masked:
                J = J[self._rows]
            J *= column
            e *= self._weights
            damping = 0.5 * float(e @ e) + _DAMPING
            step = self._step(J, e, damping, pull)
            largest = _largest(step)
            if largest > 0.5:
                step *= 0.5 / largest
            kept = q + step
            if not all(map(_within, lower, kept.tolist(), upper)):
                kept = self._saturate(q, J, e, damping, pull)
                if pull is None and float(np.abs(kept - q).max()) < 1e-7:
                    break  # as near as the limits allow
            elif largest < 1e-7 and pull is None:
                break
            q, pull = kept, None
        return q, worst

    def _step(self, J: Array, e: Array, damping: float, pull: Array | None) -> Array:
        """Damped least squares with a null-space step: ``z + J^T (J J^T + damping)^-1 (e - J z)``."""
        turned = J.T
        A = J @ turned
        A += damping * self._eye
        if pull is None:
            return turned @ eigenpy.LLT(A).solve(e)
        return pull + turned @ eigenpy.LLT(A).solve(e - J @ pull)

    def _saturate(self, q: Array, J: Array, e: Array, damping: float, pull: Array | None) -> Array:
        """The step's result within the limits: joints that pass one are set on it, the worst first."""
        free = np.ones(self._n, bool)
        z = np.zeros(self._n) if pull is None else pull
        step = np.zeros(self._n)
        while free.any():
            step[free] = self._step(J[:, free], e - J[:, ~free] @ step[~free], damping, z[free])
            largest = float(np.abs(step[free]).max())
            if largest > 0.5:
                step[free] *= 0.5 / largest
            excess = np.maximum(q + step - self._upper, self._lower - q - step)
            excess[~free] = 0.0
            worst = int(np.argmax(excess))
            if excess[worst] <= 0.0:
                break
            limit = self._upper if step[worst] > 0.0 else self._lower
            step[worst] = limit[worst] - q[worst]
            free[worst] = False
        return np.minimum(np.maximum(q + step, self._lower), self._upper)

    def _error(self, q: Array, pose: Any) -> Array:
        pin.forwardKinematics(self._model, self._data, q)
        miss = pin.updateFramePlacement(self._model, self._data, self._frame).actInv(pose)
        return np.concatenate([miss.translation, pin.log3(miss.rotation)]) * (self.robot.task_mask > 0.0)

    def _cost(self, q: Array, pose: Any) -> float:
        e = self._error(q, pose)[self._rows] * self._weights
        return float(e @ e)

    def _missed(self, q: Array, pose: Any) -> tuple[float, float] | None:
        """Metres and radians by which the tool misses the pose; None where that is nothing to speak of."""
        e = self._error(q, pose)
        distance, angle = float(np.linalg.norm(e[:3])), float(np.linalg.norm(e[3:]))
        return (distance, angle) if distance > _MISS[0] or angle > _MISS[1] else None

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


def _unreachable(robot: str, pose: Any, distance: float, angle: float, how: str = "") -> UnreachableError:
    x, y, z = pose.translation
    return UnreachableError(
        f"{robot} cannot bring its tool to ({x:.3f}, {y:.3f}, {z:.3f}) m{' ' * bool(how)}{how}: "
        f"the nearest pose misses by {1000 * distance:.1f} mm and {np.rad2deg(angle):.1f} degrees",
        distance,
        angle,
    )


def _largest(values: Array) -> float:
    """Largest magnitude of a few numbers; NumPy takes longer for so few."""
    return float(max(map(abs, values.tolist())))


def _within(low: float, x: float, high: float) -> bool:
    return low <= x <= high
