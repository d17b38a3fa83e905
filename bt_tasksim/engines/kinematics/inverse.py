"""Inverse kinematics of an arm.

A Levenberg-Marquardt iteration with a damping that follows the remaining error (T. Sugihara,
"Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", IEEE Trans. Robotics 27(5),
2011; its ancestor: Y. Nakamura and H. Hanafusa, "Inverse kinematic solutions with singularity robustness for
robot manipulator control", J. Dyn. Sys. Meas. Control 108(3), 1986). The posture preference acts in the null
space of the tool's motion (A. Liegeois, IEEE Trans. SMC 7(12), 1977). Joints that would pass a limit are set
on it and the others make up for them (F. Flacco, A. De Luca, O. Khatib, "Motion control of redundant robots
under joint constraints: saturation in the null space", ICRA 2012).
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import eigenpy
import numpy as np
import pinocchio as pin

from bt_tasksim.core.errors import UnreachableError
from bt_tasksim.core.poses import Array
from bt_tasksim.robot.description import RobotDescription

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
_LOCAL = pin.ReferenceFrame.LOCAL


class InverseKinematics:
    """Joints of an arm for poses of its tool. The model is constant, and nothing is kept between two calls.

    Args:
        robot: The robot.
        model: Its arm alone, with a frame ``tool``.
        patience: Seconds after which a search for another posture gives up.
    """

    def __init__(self, robot: RobotDescription, model: pin.Model, patience: float = math.inf) -> None:
        self._robot, self._model, self._patience = robot, model, patience
        self._data = model.createData()
        self._frame = model.getFrameId("tool", pin.FrameType.OP_FRAME)
        self._n = len(robot.arm_joints)
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

    def near(self, pose: pin.SE3, last: Array) -> Array:
        """Joints ``(n_arm,)`` for a pose, continuous with the last ones where that is possible.

        Raises:
            UnreachableError: No posture brings the tool there, or only one that the arm would have to swing
                to while the tool hardly moves.
        """
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
            raise _unreachable(self._robot.name, pose, *missed, "without swinging into another posture")
        return other

    def nearest(self, pose: pin.SE3, starts: Sequence[Array], posture: Array | None = None) -> Array:
        """Joints ``(n_arm,)`` for a pose, of the solutions that are found the one nearest to a posture.

        Args:
            pose: The tool's pose.
            starts: Joints to begin at, before the rest posture and fixed random ones.
            posture: Joints to come near to; by default the rest posture.

        Raises:
            UnreachableError: No posture brings the tool there; says by how much the nearest one misses.
        """
        return self._search(pose, [*starts, self._rest], self._rest if posture is None else posture)

    def _search(
        self, pose: pin.SE3, starts: Sequence[Array], posture: Array, best: Array | None = None
    ) -> Array:
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
        raise _unreachable(self._robot.name, pose, *missed)

    def _settle(self, q: Array, pose: pin.SE3, posture: Array) -> Array:
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
        self, q: Array, pose: pin.SE3, iterations: int, pull: Array | None = None
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

    def _error(self, q: Array, pose: pin.SE3) -> Array:
        pin.forwardKinematics(self._model, self._data, q)
        miss = pin.updateFramePlacement(self._model, self._data, self._frame).actInv(pose)
        return np.concatenate([miss.translation, pin.log3(miss.rotation)]) * (self._robot.task_mask > 0.0)

    def _cost(self, q: Array, pose: pin.SE3) -> float:
        e = self._error(q, pose)[self._rows] * self._weights
        return float(e @ e)

    def _missed(self, q: Array, pose: pin.SE3) -> tuple[float, float] | None:
        """Metres and radians by which the tool misses the pose; None where that is nothing to speak of."""
        e = self._error(q, pose)
        distance, angle = float(np.linalg.norm(e[:3])), float(np.linalg.norm(e[3:]))
        return (distance, angle) if distance > _MISS[0] or angle > _MISS[1] else None


def _unreachable(robot: str, pose: pin.SE3, distance: float, angle: float, how: str = "") -> UnreachableError:
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
