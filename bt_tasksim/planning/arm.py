"""An arm for planning: where its tool is, and which joints bring it to a pose.

The inverse kinematics is that of `bt_tasksim.robot.kinematics.inverse` for one row, by Pinocchio: a search
asks for one pose after the other, and for one at a time it is ten times as fast as arrays are.

An arm of fewer than six joints cannot have every pose. It brings the tool to the place, and turns it as near
as it can to what is asked: the place comes first, the rotation in its null space (Y. Nakamura, H. Hanafusa,
T. Yoshikawa, "Task-priority based redundancy control of robot manipulators", Int. J. Robotics Research 6(2),
1987).
"""

from __future__ import annotations

import math
from operator import gt, lt

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dgesv

from bt_tasksim.core.poses import Array
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.scratch import Scratch
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.chain import Chain, poses_of
from bt_tasksim.robot.kinematics.models import arm_model, pose_of, se3

_JUMP = 1.5
"""Radians that no joint turns between two neighbouring poses of a line, which are some centimetres apart."""
_ASIDE = 0.012
"""Metres by which the tool may leave the line where all joints turn evenly from one pose to the next."""
_TOLERANCE = 1e-4
"""Metres and radians that may remain of each component of a pose."""
_ITERATIONS = 40
_PATIENCE, _PROGRESS = 6, 0.7
"""Iterations within which what is left of the way has to shrink to this share: else it is out of reach."""
_LONGEST, _PULL, _PULL_LIMIT = 0.5, 0.2, 0.05
"""As in `bt_tasksim.robot.kinematics.inverse`."""
_LENGTH = 0.3
_SEEDS, _AWAY = 4, 0.5
_DAMPING = 1e-7
LEANS = 0.12
"""Radians by which the tool of an arm with fewer than six joints may be turned from what is asked."""
SWAYS = 0.6
"""The same on its way, where nothing but the way asks for a rotation: such an arm reaches less far up and out
with its tool upright than with it slanted."""
SET_DOWN = 0.25
"""The same where something is set down that has turned in its hand, and cannot be set upright otherwise."""
FULL = 6
"""Joints with which an arm can have any pose about it."""
_PATIENT, _LITTLE = 14, 2e-3
"""Iterations before it is looked at whether such an arm comes nearer; metres near enough to go on anyway."""
_AT_ONCE = 0.3
"""Radians by which any joint turns at once for the rotation alone: more would lose the place."""
_TURNED = 1e-3
"""Radians by which a step still turns joints at which the nearest rotation counts as found."""
_TURNING = 1e-2
"""Damping of the rotation in the place's null space: radians that a turn of one radian may cost."""
_WITHIN = 0.02
"""Radians within the joints' limits at which postures end: an arm that follows a way with some error, and
corrects where it goes, is to have joints left for that."""


_KEPT = 20_000
"""Answers that are kept, a few MB."""
_MANY = 8
"""Postures from which on their tool poses are computed together."""


class _Scratch(Scratch):
    """What each thread has of its own.

    Attributes:
        solved: Joints that were found, or None, by what was asked: where nothing serves, the same tool poses
            are asked about with more room and with less.
    """

    def __init__(self) -> None:
        self.solved: dict[tuple[bytes, bytes, bytes, float], Array | None] = {}


class Arm:
    """The arm of a robot.

    Args:
        robot: The robot.

    Raises:
        InputError: The description does not fit its URDF.
    """

    def __init__(self, robot: RobotDescription) -> None:
        self.robot = robot
        self._model = arm_model(robot, bodies_of(robot).model)
        self._scratch = _Scratch()  # the arm of a robot is made once for all threads
        self._frame = self._model.getFrameId("tool")
        self._chain = Chain.of(self._model, "tool", robot.rest)
        self._rows = np.flatnonzero(robot.task_mask > 0.0)
        self._all = len(self._rows) == len(robot.task_mask)
        weights = robot.task_mask * ([1.0] * 3 + [_LENGTH] * 3)
        self._weights, self._down = weights[self._rows], weights[self._rows][:, None]
        self._posture = _PULL * robot.posture
        within = np.minimum(_WITHIN, (robot.arm_upper - robot.arm_lower) / 4)
        self._lower, self._upper = robot.arm_lower + within, robot.arm_upper - within
        self._ends: tuple[list[float], list[float]] = (self._lower.tolist(), self._upper.tolist())
        rng = np.random.default_rng(3)
        spread = rng.uniform(robot.arm_lower, robot.arm_upper, (_SEEDS, len(robot.arm_joints)))
        self.seeds: Array = robot.rest + _AWAY * (spread - robot.rest)
        """Postures ``(k, n_arm)`` to begin at beside others, about the middle of the joints' ranges."""

    @property
    def _data(self) -> pin.Data:
        """What Pinocchio writes into, of this thread."""
        return self._scratch.data(self._model)

    def tool(self, joints: Array) -> Array:
        """The tool pose ``(7,)`` of joints ``(n_arm,)``."""
        data = self._data
        pin.framesForwardKinematics(self._model, data, joints)
        return pose_of(data.oMf[self._frame])

    def tools(self, joints: Array) -> Array:
        """Tool poses ``(n, 7)`` of joints ``(n, n_arm)``."""
        if len(joints) < _MANY:
            return np.array([self.tool(q) for q in joints])
        return poses_of(self._chain.seen(np.ascontiguousarray(joints.T))[0])

    def supple(self, joints: Array) -> Array:
        """Metres ``(n,)`` that the tool goes for a radian of the joints ``(n, n_arm)``, where least far.

        The smallest singular value of the Jacobian of the tool's place: next to nothing where the arm is near
        a singular posture, and as stiff as rock in one direction (T. Yoshikawa, "Manipulability of robotic
        mechanisms", Int. J. Robotics Research 4(2), 1985).
        """
        moves = self._chain.jacobian(self._chain.seen(np.ascontiguousarray(joints.T)))[:, :3]
        square = np.einsum("jan,jbn->nab", moves, moves)
        found: Array = np.sqrt(np.maximum(np.linalg.eigvalsh(square)[:, 0], 0.0))
        return found

    def _place(self, joints: Array) -> Array:
        """Where the tool is ``(3,)`` for joints ``(n_arm,)``."""
        data = self._data
        pin.forwardKinematics(self._model, data, joints)
        found: Array = pin.updateFramePlacement(self._model, data, self._frame).translation
        return found

    def joints(
        self, tool: Array, start: Array, *, towards: Array | None = None, leans: float = LEANS
    ) -> Array | None:
        """Joints ``(n_arm,)`` for a tool pose ``(7,)``; None where none are found from ``start``.

        Args:
            tool: The pose.
            start: Joints ``(n_arm,)`` to begin at.
            towards: Joints ``(n_arm,)`` to which the arm is drawn a little, as it is to a posture when it
                follows commands.
            leans: Radians by which the tool may be turned from the pose, by an arm of fewer than six joints.
        """
        drawn = b"" if towards is None else towards.tobytes()
        asked, solved = (tool.tobytes(), start.tobytes(), drawn, leans), self._scratch.solved
        if asked not in solved:
            if len(solved) >= _KEPT:
                solved.clear()
            solved[asked] = self._solve(tool, start, towards, leans)
        found = solved[asked]
        return None if found is None else found.copy()

    def _solve(self, tool: Array, start: Array, towards: Array | None, leans: float) -> Array | None:
        """See `joints`."""
        target = se3(tool)
        q = np.minimum(np.maximum(start, self._lower), self._upper)
        if len(q) < FULL:
            return self._nearest(q, target, leans)
        pull = None
        if towards is not None:
            pull = self._posture * (towards - q)
            pull *= _PULL_LIMIT / max(_largest(pull), _PULL_LIMIT)
        data, before = self._data, list[float]()
        for k in range(_ITERATIONS + 1):
            pin.computeJointJacobians(self._model, data, q)
            here = pin.updateFramePlacement(self._model, data, self._frame)
            error = pin.log6(here.actInv(target)).vector
            if not self._all:
                error = error[self._rows]
            left = _largest(error)
            if pull is None and left <= _TOLERANCE:
                return q
            if k == _ITERATIONS or (k >= _PATIENCE and left > _PROGRESS * before[k - _PATIENCE]):
                break
            before.append(left)
            jacobian = pin.getFrameJacobian(self._model, data, self._frame, pin.LOCAL)
            if not self._all:
                jacobian = jacobian[self._rows]
            q = self._moved(q, error, jacobian, pull)
            pull = None
        return None

    def _nearest(self, q: Array, target: pin.SE3, leans: float) -> Array | None:
        """Joints that bring the tool to the place, turned from what is asked by no more than ``leans``."""
        data, before = self._data, list[float]()
        for k in range(_ITERATIONS + 1):
            pin.computeJointJacobians(self._model, data, q)
            here = pin.updateFramePlacement(self._model, data, self._frame)
            off = here.rotation.T @ (target.translation - here.translation)
            turn = pin.log3(here.rotation.T @ target.rotation)
            left = float(np.abs(off).max())
            lost = k >= _PATIENT and left > max(_PROGRESS * before[k - _PATIENCE], _LITTLE)
            if k == _ITERATIONS or lost:
                return None
            before.append(left)
            jacobian = pin.getFrameJacobian(self._model, data, self._frame, pin.LOCAL)
            after = self._stepped(q, off, turn, jacobian)
            if left <= _TOLERANCE and float(np.abs(after - q).max()) <= _TURNED:
                return q if float(np.linalg.norm(turn)) <= leans else None
            q = after
        return None

    def _stepped(self, q: Array, off: Array, turn: Array, jacobian: Array) -> Array:
        """Joints one step on: towards the place, and in its null space towards the rotation."""
        free = np.ones(len(q))
        for _ in range(len(q)):
            move, rotate = jacobian[:3] * free, jacobian[3:] * free
            inverse = move.T @ np.linalg.inv(move @ move.T + (0.5 * float(off @ off) + _DAMPING) * np.eye(3))
            step = inverse @ off
            rest = rotate - rotate @ inverse @ move
            more = rest.T @ np.linalg.solve(rest @ rest.T + _TURNING * np.eye(3), turn - rotate @ step)
            step += more * (_AT_ONCE / max(float(np.abs(more).max()), _AT_ONCE))
            step *= _LONGEST / max(float(np.abs(step).max()), _LONGEST)
            past = (q + step < self._lower) | (q + step > self._upper)
            if not (past & (free > 0.0)).any():
                break
            free = np.where(past, 0.0, free)
        return np.clip(q + step, self._lower, self._upper)

    def _moved(self, q: Array, error: Array, jacobian: Array, pull: Array | None) -> Array:
        e, j = error * self._weights, jacobian * self._down
        damping, free = 0.5 * float(e.dot(e)) + _DAMPING, None
        lower, upper = self._ends
        for _ in range(2):
            jf, z = (j, pull) if free is None else (j * free, None if pull is None else pull * free)
            across = jf.T
            square = jf.dot(across)
            square.ravel()[:: len(e) + 1] += damping
            if z is None:
                step = across.dot(dgesv(square, e)[2])
            else:
                step = z + across.dot(dgesv(square, e - jf.dot(z))[2])
            largest = _largest(step)
            if not largest <= _LONGEST:
                step *= _LONGEST / largest
            after: Array = q + step
            joints = after.tolist()
            if not (any(map(lt, joints, lower)) or any(map(gt, joints, upper))):
                return after
            past = (after < self._lower) | (after > self._upper)
            free = np.where(past, 0.0, 1.0 if free is None else free)
        return np.minimum(np.maximum(after, self._lower), self._upper)

    def along(
        self, start: Array, tools: Array, leans: float = LEANS, towards: Array | None = None
    ) -> Array | None:
        """Joints ``(n, n_arm)`` that lead the tool through poses ``(n, 7)`` without a jump.

        Args:
            start: Joints ``(n_arm,)`` where the tool is before the first pose.
            tools: The poses, some centimetres apart at most.
            leans: As of `joints`, at the last of the poses; before that it may be more.
            towards: Joints ``(n_arm,)`` to which the arm is drawn a little, by default those at rest.

        Returns:
            The joints; None where the arm cannot follow.
        """
        found, now = [], np.asarray(start)
        drawn = self.robot.rest if towards is None else towards
        before = self.tool(now)
        for k, tool in enumerate(tools):
            most = max(leans, SWAYS) if k < len(tools) - 1 else leans
            joints = self.joints(tool, now, towards=drawn, leans=most)
            if joints is None or not self._between(now, joints, before, tool):
                return None
            now, before = joints, tool
            found.append(now)
        return np.array(found)

    def _between(self, a: Array, b: Array, before: Array, after: Array) -> bool:
        """Half way between two postures the tool is about half way between their poses."""
        if _largest(b - a) > _JUMP:
            return False
        aside = self._place(0.5 * (a + b)) - 0.5 * (before[:3] + after[:3])
        return math.sqrt(aside.dot(aside)) <= _ASIDE


def _largest(values: Array) -> float:
    """The largest of some numbers ``(n,)``, whatever their signs."""
    return float(max(map(abs, values.tolist())))


def arm_of(robot: RobotDescription) -> Arm:
    """The arm of a robot, made once.

    Raises:
        InputError: The description does not fit its URDF.
    """
    found: Arm = robot.derived("arm", Arm)
    return found
