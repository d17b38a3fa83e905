"""Commands of many worlds to joint targets: tracking, velocity limits, the hand.

How joints are found for a pose stands in `bt_tasksim.robot.kinematics.inverse`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
import pinocchio as pin

from bt_tasksim.core.poses import Array, array_namespace, constant, host
from bt_tasksim.core.world import Command, JointTarget, WorldState
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.chain import placements, poses_of
from bt_tasksim.robot.kinematics.failures import Failures, Reach
from bt_tasksim.robot.kinematics.inverse import InverseKinematics
from bt_tasksim.robot.kinematics.linear import total
from bt_tasksim.robot.kinematics.models import arm_model, full_model
from bt_tasksim.robot.kinematics.rows import (
    at_least,
    columns,
    contiguous,
    either,
    every,
    highest,
    put,
    put_in,
    some,
    taken,
    taken_of,
    where_true,
)
from bt_tasksim.scene.configuration import ActorConfiguration

_UNIT = (0.25, 4.0)
"""Squared length of a quaternion that is meant to be a unit one."""


class Solution(NamedTuple):
    """What `BatchKinematics.solve` found.

    Attributes:
        target: Positions and velocities ``(k, n_joints)``.
        failures: Rows that cannot have what they asked for; their targets stay.
    """

    target: JointTarget
    failures: Failures


class _Memory(NamedTuple):
    """What is kept of worlds between two calls; rows last.

    Attributes:
        target: ``(n_joints, N)`` where the joints have been sent to.
        goal: ``(n_joints, N)`` where that is on its way to.
        seen: ``(n + 1, 3, 4, N)`` what `Chain.seen` says of the goal.
        tool: ``(7, N)`` the tool pose that the goal is for; NaN before there was one.
        hand: ``(1 + n_synergies, N)`` the hand command that it is for; NaN before there was one.
        begun: ``(N,)`` boolean, there is a target.
        per_step: ``(n_joints, N)`` one over the farthest that a joint may go in a control period.
        rate: ``(1, N)`` control periods in a second.
    """

    target: Array
    goal: Array
    seen: Array
    tool: Array
    hand: Array
    begun: Array
    per_step: Array
    rate: Array


class BatchKinematics:
    """Tracks commands of ``n`` worlds with one arm and hand; each world as if it were alone.

    It starts from its own last solution, never from the measured joints, so that a loaded arm does not drift.
    The joint target follows that solution as fast as the joints' velocity limits allow: a command that moves
    faster is caught up with later, all joints slowed by the same factor.

    Args:
        robot: The robot.
        model: Its arm alone, with a frame ``tool``, see `arm_model`.
        n: Number of worlds.
        like: An array of the library, type and device of what is to be computed; by default NumPy, float64.
        control_period: Seconds between two calls of `solve`, until `reset` says otherwise.
        patience: Seconds that a call takes which a few iterations do not settle, for real time: going on from
            the last posture has half of them, and a search for another one what is left. By default both go
            on to their end, and so do not depend on the machine's speed.
    """

    def __init__(
        self,
        robot: RobotDescription,
        model: pin.Model,
        n: int,
        like: Array | None = None,
        control_period: float = 0.05,
        patience: float = math.inf,
    ) -> None:
        self.robot, self.n = robot, n
        self._like = like = np.empty(0) if like is None else like
        self.inverse = InverseKinematics(robot, model, like, patience)
        self._arm, self._joints = len(robot.arm_joints), len(robot.joints)
        hand = np.abs(robot.hand_closed - robot.hand_open)
        if len(robot.synergies):
            hand = np.maximum(hand, np.abs(robot.synergy_directions).max(axis=0))
        speed = np.concatenate([robot.arm_velocity, np.maximum(hand, 1e-9) * robot.hand_speed])
        self._slowness = constant(1.0 / speed[:, None], like)
        low, high = robot.hand_range
        self._lower = constant(np.concatenate([robot.arm_lower, low])[:, None], like)
        self._upper = constant(np.concatenate([robot.arm_upper, high])[:, None], like)
        self._all = np.arange(n)
        self._memory = self._fresh(np.full(n, 1.0 / control_period))
        self._still: JointTarget | None = None

    @classmethod
    def of(cls, robot: RobotDescription, n: int, like: Array | None = None) -> Self:
        """The kinematics of ``n`` worlds of a robot.

        Raises:
            InputError: The description does not fit its URDF.
        """
        return cls(robot, arm_model(robot, full_model(robot)[0]), n, like)

    def reset(self, rows: Sequence[int] | np.ndarray, configurations: Sequence[ActorConfiguration]) -> None:
        """Worlds begin new episodes: forget their last targets."""
        self.restart(np.asarray(rows, int), np.array([c.control_frequency for c in configurations]))

    def restart(self, rows: np.ndarray, rates: np.ndarray) -> None:
        """`reset` of worlds, whose commands come at so many a second ``(k,)``."""
        fresh = self._fresh(np.asarray(rates, float))
        if len(rows) < self.n or np.any(rows != self._all):
            fresh = _Memory(*put_in(self._memory, rows, fresh))
        self._memory, self._still = fresh, None

    def _fresh(self, rates: np.ndarray) -> _Memory:
        like, n, joints = self._like, len(rates), np.zeros((self._joints, len(rates)))
        xp = array_namespace(like)
        rate = constant(rates[None], like)
        return _Memory(
            constant(joints, like),
            constant(joints, like),
            constant(np.zeros((self._arm + 1, 3, 4, n)), like),
            constant(np.full((7, n), np.nan), like),
            constant(np.full((1 + len(self.robot.synergies), n), np.nan), like),
            xp.asarray(np.zeros(n, bool), device=like.device),
            self._slowness * rate,
            rate,
        )

    def solve(self, command: Command, state: WorldState, rows: np.ndarray | None = None) -> Solution:
        """Joint targets that bring the tools to ``command.tool`` in one control period.

        Args:
            command: Tool poses ``(k, 7)`` and hands ``(k, 1 + n_synergies)``; a part is None, or all of a row
                NaN, where nothing was asked of it since the reset, and its joints stay where they began. Of a
                row with a posture ``(k, n_arm)`` the joints are those nearest to it.
            state: The present state ``(k, ...)``; looked at on a world's first call after a reset only.
            rows: Which worlds these are ``(k,)``, each once; by default all.
        """
        return self.track(with_posture(command), command.hand, state.joint_position, rows)

    def track(
        self, tool: Array | None, hand: Array | None, joints: Array, rows: np.ndarray | None = None
    ) -> Solution:
        """`solve` of the parts of a command, with joints ``(k, n_joints)`` for worlds that begin.

        Behind the tool poses ``(k, 7)`` may stand postures: ``(k, 7 + n_arm)``, NaN where there is none.
        """
        if rows is not None and len(rows) == self.n and bool(np.all(rows == self._all)):
            rows = None
        memory = self._memory
        if rows is not None:
            memory = _Memory(*taken_of(memory, rows))
        memory = self._begun(memory, joints)
        memory, moved, failures = self._asked(memory, tool, hand)
        if not moved and rows is None and self._still is not None:
            return Solution(self._still, failures)
        memory, target, still = self._follow(memory, failures)
        if rows is None:
            self._memory, self._still = memory, target if still else None
        else:
            self._memory = _Memory(*put_in(self._memory, rows, memory))
            self._still = None
        return Solution(target, failures)

    def joints_at(
        self, tool: Array, seed: Array | None = None, posture: Array | None = None
    ) -> tuple[Array, Failures]:
        """Joints ``(k, n_arm)`` that bring tools to poses, in the posture nearest to the preferred one.

        Deterministic: begins at ``seed``, the rest posture, and then at fixed random postures. Keeps nothing.

        Args:
            tool: Tool poses ``(k, 7)``, robot base frame.
            seed: Joints ``(k, n_arm)`` to begin at; by default the rest posture.
            posture: Joints ``(k, n_arm)`` to come near to; by default the rest posture.

        Returns:
            The joints, and the rows that no posture brings there; theirs are the nearest that were found.
        """
        asked = columns(tool)
        turns = host(_turns(asked))
        index = np.flatnonzero(turns)
        starts = [] if seed is None else [taken(columns(seed), index)]
        near = None if posture is None else taken(columns(posture), index)
        found = self.inverse.nearest(placements(taken(asked, index)), starts, near)
        codes, misses = np.full(len(turns), int(Reach.NO_ROTATION)), np.zeros((2, len(turns)))
        codes[index], misses[:, index] = found.code, (found.distance, found.angle)
        joints = put(constant(np.full((self._arm, len(turns)), np.nan), self._like), index, found.q)
        return _rows(joints), Failures(self.robot.name, codes, host(asked).T.copy(), *misses)

    def tool_pose(self, joints: Array) -> Array:
        """Tool poses ``(k, 7)``, robot base frame, of joints ``(k, n)``: the arms', or all of them."""
        return poses_of(self.inverse.chain.seen(columns(joints[:, : self._arm]))[0, ...])

    def _begun(self, memory: _Memory, joints: Array) -> _Memory:
        """Worlds that have no target yet get their joints' positions ``(k, n_joints)``, within the limits."""
        xp = array_namespace(self._like)
        if every(memory.begun):
            return memory
        new = where_true(~memory.begun)
        start = columns(constant(joints, self._like))
        start = xp.minimum(xp.maximum(taken(start, new), self._lower), self._upper)  # encoders tremble
        return memory._replace(
            target=put(memory.target, new, start),
            goal=put(memory.goal, new, start),
            seen=put(memory.seen, new, self.inverse.chain.seen(start[: self._arm, ...])),
            begun=xp.ones_like(memory.begun),
        )

    def _asked(
        self, memory: _Memory, tool: Array | None, hand: Array | None
    ) -> tuple[_Memory, bool, Failures]:
        """New goals for the commands that are not those of the last call, and whether there are any."""
        xp = array_namespace(self._like)
        moved = False
        failures = self._none(memory.goal.shape[-1])
        goal = memory.goal
        if tool is not None:
            asked = columns(tool[:, :7])
            fresh = _new(asked, memory.tool)
            if some(fresh):
                moved = True
                index = where_true(fresh)
                posture = columns(tool[:, 7:]) if tool.shape[-1] > 7 else None
                arm, seen, failures = self._near(memory, asked, index, posture)
                goal = xp.concat([arm, goal[self._arm :, ...]], axis=0)
                if failures:
                    fresh = fresh & ~xp.asarray(failures.mask, device=goal.device)
                memory = memory._replace(goal=goal, seen=seen, tool=xp.where(fresh, asked, memory.tool))
        if hand is not None:
            asked = columns(hand)
            fresh = _new(asked, memory.hand)
            if failures:
                fresh = fresh & ~xp.asarray(failures.mask, device=goal.device)
            if some(fresh):
                moved = True
                fingers = xp.where(fresh, columns(self.robot.hand_position(hand)), goal[self._arm :, ...])
                goal = xp.concat([goal[: self._arm, ...], fingers], axis=0)
                memory = memory._replace(goal=goal, hand=xp.where(fresh, asked, memory.hand))
        return memory, moved, failures

    def _none(self, n: int) -> Failures:
        numbers = np.zeros((9, n))
        return Failures(self.robot.name, numbers[0], numbers[2:].T, numbers[0], numbers[1])

    def _near(
        self, memory: _Memory, tool: Array, index: np.ndarray, posture: Array | None
    ) -> tuple[Array, Array, Failures]:
        """The arms ``(n, N)`` for tool poses ``(7, N)`` of the rows that ask, and what their chains see."""
        last, seen, n = memory.goal[: self._arm, ...], memory.seen, tool.shape[-1]
        turns = _turns(tool)
        codes, misses = np.zeros(n, int), np.zeros((2, n))
        if not every(taken(turns, index)):
            good = host(turns)
            codes[index[~good[index]]] = Reach.NO_ROTATION
            index = index[good[index]]
        if len(index) == n:
            found = self.inverse.near(placements(tool), last, seen, posture)
            arm, seen = found.q, found.seen
            if not found.code.any():
                return arm, seen, self._none(n)
            codes, misses = found.code, np.stack([found.distance, found.angle])
        else:
            asked, begin, chain = taken_of((tool, last, seen), index)
            near = None if posture is None else taken(posture, index)
            found = self.inverse.near(placements(asked), begin, chain, near)
            arm, seen = put_in((last, seen), index, (found.q, found.seen))
            codes[index] = found.code
            misses[:, index] = found.distance, found.angle
        failed = np.flatnonzero(codes)
        if len(failed):
            arm = put(arm, failed, taken(last, failed))
            seen = put(seen, failed, taken(memory.seen, failed))
        return arm, seen, Failures(self.robot.name, codes, host(tool).T.copy(), *misses)

    def _follow(self, memory: _Memory, failures: Failures) -> tuple[_Memory, JointTarget, bool]:
        """One period's way from the last targets to the goals, within the velocity limits.

        Rows that failed stay.
        """
        xp, n = array_namespace(self._like), self._arm
        goal = memory.goal
        if failures:
            goal = xp.where(xp.asarray(failures.mask, device=goal.device), memory.target, goal)
        step = goal - memory.target
        share = abs(step) * memory.per_step
        arm, hand = highest(share[:n, ...]), highest(share[n:, ...])
        fastest = xp.maximum(arm, hand)
        target, limited = goal, fastest > 1.0
        if some(limited):
            slowed = [step[:n, ...] / at_least(arm, 1.0), step[n:, ...] / at_least(hand, 1.0)]
            step = xp.concat(slowed, axis=0)
            target = xp.where(limited, memory.target + step, target)
        asked = JointTarget(_rows(target), _rows(step * memory.rate))
        still = not failures and not some(fastest > 0.0)
        return memory._replace(target=target), asked, still


def with_posture(command: Command) -> Array | None:
    """A command's tool poses, with the postures behind them where there are any."""
    if command.tool is None or command.posture is None:
        return command.tool
    return array_namespace(command.tool).concat([command.tool, command.posture], axis=-1)


def _new(asked: Array, before: Array) -> Array:
    """Rows ``(N,)`` of which something is asked ``(k, N)`` that is not what was asked before."""
    fresh = either(asked != before)
    return fresh & either(asked == asked) if some(fresh) else fresh  # a number equals itself, NaN does not


def _turns(poses: Array) -> Array:
    """The quaternions of poses ``(7, N)`` are, but for rounding, unit ones ``(N,)``."""
    square = total(poses[3:, ...] * poses[3:, ...])
    return (square > _UNIT[0]) & (square < _UNIT[1])


def _rows(array: Array) -> Array:
    return contiguous(array_namespace(array).permute_dims(array, (1, 0)))
