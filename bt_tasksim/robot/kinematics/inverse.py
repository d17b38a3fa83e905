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
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from bt_tasksim.core.poses import Array, array_namespace, clip, constant, host, indices
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.chain import Chain, difference
from bt_tasksim.robot.kinematics.failures import Reach
from bt_tasksim.robot.kinematics.linear import solve_symmetric, total
from bt_tasksim.robot.kinematics.rows import (
    at_least,
    chosen,
    either,
    every,
    highest,
    joined,
    put,
    put_in,
    some,
    taken,
    taken_of,
    where_true,
)

_TOLERANCE = 5e-5
"""Largest component of the remaining error, m and rad, of a pose that counts as solved exactly."""
_MISS = (1e-3, 5e-3)
"""A nearest pose that misses by no more (m, rad) counts as reached; arms are not more accurate."""
_BESIDE = (1.5e-2, 3e-2)
"""A posture that was asked for is taken where its tool is no farther (m, rad) from a pose that cannot be
reached: a tool may be corrected by some millimetres on a way that was planned without that."""
_LENGTH = 0.3
"""Metres that weigh as much as one radian where position and rotation cannot both be had."""
_DAMPING = 1e-7
_LONGEST = 0.5
"""Largest step of any joint in one iteration, rad."""
_STUCK = 1e-7
"""A step of no joint more than this gets nowhere, rad."""
_TRACK, _HARDER, _SETTLE = 6, 200, 60
"""Iterations of a tracking step, of a solve that tries hard, and of settling into the preferred posture."""
_PULL = 0.2
"""Share of the way to the preferred posture that one tracking step asks of the null space."""
_PULL_LIMIT = 0.05
"""Largest such step of any joint, rad."""
_SWING, _SWING_PER_METRE, _SWING_PER_RADIAN = 0.5, 10.0, 2.0
"""A tracked arm may change its posture at once by so much: rad, and more for the way that the tool goes."""
_SETTLING = 0.3
"""Share of the way to the preferred posture that one step of settling asks of the null space."""
_RESTARTS = 24
"""Random postures to begin at."""


class Postures(NamedTuple):
    """Joints for poses, one column a row.

    Attributes:
        q: Joints ``(n, N)`` within their limits; of a row that failed the nearest that were found.
        seen: ``(n + 1, 3, 4, N)``, what `Chain.seen` says of them.
        code: ``(N,)`` NumPy, of `Reach`: how it went.
        distance: ``(N,)`` NumPy, metres by which a row that failed misses; else zero.
        angle: ``(N,)`` NumPy, radians by which it misses.
    """

    q: Array
    seen: Array
    code: Array
    distance: Array
    angle: Array


class _Reached(NamedTuple):
    """Where an iteration ended: joints ``(n, N)``, the chain there, and the largest error ``(N,)`` left."""

    q: Array
    seen: Array
    worst: Array


@dataclass(frozen=True)
class _Missed:
    """Sizes ``(N,)`` in NumPy of what is left of errors: metres, radians, and both weighed together."""

    distance: Array
    angle: Array
    cost: Array

    @property
    def little(self) -> Array:
        """It is nothing to speak of ``(N,)``."""
        return (self.distance <= _MISS[0]) & (self.angle <= _MISS[1])


class InverseKinematics:
    """Joints of an arm for poses of its tool, many at once; nothing is kept between two calls.

    Rows come last in all arrays, and each is solved as if it were alone.

    Args:
        robot: The robot.
        model: Its arm alone, with a frame ``tool``.
        like: An array of the library, type and device to compute with.
        patience: Seconds after which a call that a few iterations do not settle ends with what it has.
    """

    def __init__(
        self, robot: RobotDescription, model: pin.Model, like: Array, patience: float = math.inf
    ) -> None:
        self.chain = Chain.of(model, "tool", like)
        self._patience = patience
        self._n = len(robot.arm_joints)
        column = (
            robot.arm_lower[:, None].copy(),
            robot.arm_upper[:, None].copy(),
            robot.rest[:, None].copy(),
        )
        self._lower, self._upper, self._rest = (constant(values, like) for values in column)
        self._pull = constant(_PULL * robot.posture[:, None], like)
        asked = np.flatnonzero(robot.task_mask > 0.0)
        self._asked = None if len(asked) == 6 else asked
        weights = robot.task_mask * ([1.0] * 3 + [_LENGTH] * 3)
        self._weights = constant(weights[asked][:, None], like)
        self._counted = constant((robot.task_mask > 0.0).astype(float)[:, None], like)
        self._eye = constant(np.eye(len(asked))[..., None], like)
        rng = np.random.default_rng(0)
        self._starts = constant(rng.uniform(robot.arm_lower, robot.arm_upper, (_RESTARTS, self._n)).T, like)

    def near(self, goal: Array, last: Array, seen: Array, posture: Array | None = None) -> Postures:
        """Joints for placements, continuous with the last ones where that is possible.

        A row fails where no posture brings the tool there, or only one that the arm would have to swing to
        while the tool hardly moves.

        Args:
            goal: Placements of the tool ``(3, 4, N)``.
            last: The joints before ``(n, N)``.
            seen: ``(n + 1, 3, 4, N)``, what `Chain.seen` says of those.
            posture: Joints ``(n, N)`` to come near to, instead of going on from the last ones; NaN where
                there are none.
        """
        pull = self._pull * (self._rest - last)
        given = np.zeros(0, int)
        if posture is not None and some(asked := ~either(posture != posture)):  # a number equals itself
            xp = array_namespace(goal)
            given = where_true(asked)
            start = clip(taken(posture, given), self._lower, self._upper)
            last, seen = put_in((last, seen), given, (start, self.chain.seen(start)))
            pull = xp.where(asked, xp.zeros_like(pull), pull)
        pull = pull * (_PULL_LIMIT / at_least(_largest(pull), _PULL_LIMIT))
        reached = self._iterate(last, goal, _TRACK, pull, seen)
        rows = goal.shape[-1]
        found = Postures(reached.q, reached.seen, *np.zeros((3, rows)))
        solved = reached.worst <= _TOLERANCE
        if every(solved):
            return found
        hard = where_true(~solved)
        found = _with(found, hard, self._again(*taken_of((goal, last), hard)))
        failed = np.intersect1d(np.flatnonzero(found.code != Reach.REACHED), given)
        return self._taken_as_asked(found, failed, goal, last, seen) if len(failed) else found

    def _taken_as_asked(
        self, found: Postures, rows: np.ndarray, goal: Array, asked: Array, seen: Array
    ) -> Postures:
        """With those of some rows whose postures ``(n, N)`` bring the tool about where it is to be."""
        asked, seen, goal = taken_of((asked, seen, goal), rows)
        missed = self._missed(seen, goal)
        near = np.flatnonzero((missed.distance <= _BESIDE[0]) & (missed.angle <= _BESIDE[1]))
        if not len(near):
            return found
        those = Postures(*taken_of((asked, seen), near), *np.zeros((3, len(near))))
        return _with(found, rows[near], those)

    def _again(self, goal: Array, last: Array) -> Postures:
        """`near` for rows that a few iterations have not brought there; going on has half of the patience."""
        now = time.monotonic()
        reached = self._iterate(last, goal, _HARDER, until=now + 0.5 * self._patience)
        missed = self._missed(reached.seen, goal)
        rows = goal.shape[-1]
        found = Postures(reached.q, reached.seen, *np.zeros((3, rows)))
        left = np.flatnonzero(~((host(reached.worst) <= _TOLERANCE) | missed.little))
        if not len(left):
            return found
        goal, last = taken_of((goal, last), left)
        way = self._missed(self.chain.seen(last), goal)
        swing = _SWING + _SWING_PER_METRE * way.distance + _SWING_PER_RADIAN * way.angle
        best = _Reached(*taken_of(reached, left))
        other = self._search(goal, [self._rest], last, now + self._patience, best)
        swings = (other.code == Reach.REACHED) & (host(_largest(other.q - last)) > swing)
        other.code[swings] = Reach.SWINGS
        other.distance[swings], other.angle[swings] = (
            missed.distance[left][swings],
            missed.angle[left][swings],
        )
        return _with(found, left, other)

    def nearest(self, goal: Array, starts: list[Array], posture: Array | None = None) -> Postures:
        """Joints for placements, of the solutions that are found the ones nearest to a posture.

        A row fails where no posture brings the tool there.

        Args:
            goal: Placements of the tool ``(3, 4, N)``.
            starts: Joints ``(n, N)`` or ``(n, 1)`` to begin at, before the rest posture and random ones.
            posture: Joints ``(n, N)`` or ``(n, 1)`` to come near to; by default the rest posture.
        """
        until = time.monotonic() + self._patience
        return self._search(goal, [*starts, self._rest], self._rest if posture is None else posture, until)

    def _search(
        self, goal: Array, starts: list[Array], posture: Array, until: float, best: _Reached | None = None
    ) -> Postures:
        """The solutions nearest to a posture from given starts, or else from the first good random one."""
        xp = array_namespace(goal)
        rows = goal.shape[-1]
        posture = xp.broadcast_to(posture, (self._n, rows))
        tries = xp.stack(
            [clip(xp.broadcast_to(x, (self._n, rows)), self._lower, self._upper) for x in starts], axis=1
        )
        first = tries[:, 0, ...]
        at = best or _Reached(first, self.chain.seen(first), goal[0, 0, ...])
        missed = self._missed(at.seen, goal)
        least = missed.cost if best is not None else np.full(rows, np.inf)
        found = Postures(at.q, at.seen, np.full(rows, Reach.UNREACHABLE), missed.distance, missed.angle)
        left = np.arange(rows)
        random = xp.broadcast_to(self._starts[..., None], (self._n, _RESTARTS, rows))
        for begin, all_count in ((tries, True), (random, False)):
            if not all_count and time.monotonic() > until:
                break
            found, least = self._try(found, least, left, taken(begin, left), goal, posture, all_count, until)
            left = np.flatnonzero(found.code != Reach.REACHED)
            if not len(left):
                break
        return found

    def _try(
        self,
        found: Postures,
        least: Array,
        left: np.ndarray,
        starts: Array,
        goal: Array,
        posture: Array,
        all_count: bool,
        until: float,
    ) -> tuple[Postures, Array]:
        """Better solutions of the rows ``left`` from starts ``(n, k, rows)``, tried all at once.

        Args:
            found: The best so far, of all rows.
            least: What they miss by ``(N,)``.
            left: The rows.
            starts: Where to begin.
            goal: Placements of all rows.
            posture: Joints ``(n, N)`` to come near to.
            all_count: The solution nearest to the posture counts, of all starts; else the first start's.
            until: When to give up, on the clock of `time.monotonic`; what has been found by then counts.
        """
        xp = array_namespace(goal)
        many = starts.shape[1]
        of = np.tile(left, many)
        goals, postures = taken_of((goal, posture), of)
        reached = self._iterate(xp.reshape(starts, (self._n, len(of))), goals, _HARDER, until=until)
        missed = self._missed(reached.seen, goals)
        good = ((host(reached.worst) <= _TOLERANCE) | missed.little).reshape(many, len(left))
        cost = missed.cost.reshape(many, len(left))
        pick = np.where(good.any(axis=0), np.argmax(good, axis=0), np.argmin(cost, axis=0))
        column = pick * len(left) + np.arange(len(left))
        improved = good.any(axis=0) | (cost.min(axis=0) < least[left])
        least = least.copy()
        least[left] = np.minimum(least[left], cost.min(axis=0))
        if good.any():
            settled = good.copy()
            if not all_count:
                settled &= np.cumsum(good, axis=0) == 1
            which = np.flatnonzero(settled.reshape(-1))
            here, chain, there, towards = taken_of((reached.q, reached.seen, goals, postures), which)
            after = self._settle(here, chain, there, towards, until)
            q, seen = put_in((reached.q, reached.seen), which, after)
            reached = reached._replace(q=q, seen=seen)
            apart = host(_square(reached.q - postures)).reshape(many, len(left))
            nearest = np.argmin(np.where(settled, apart, np.inf), axis=0)
            column = np.where(good.any(axis=0), nearest, pick) * len(left) + np.arange(len(left))
        better = np.flatnonzero(improved)
        chosen = column[better]
        code = np.where(good.any(axis=0)[better], Reach.REACHED, Reach.UNREACHABLE)
        fails = code != Reach.REACHED
        update = Postures(
            taken(reached.q, chosen),
            taken(reached.seen, chosen),
            code,
            np.where(fails, missed.distance[chosen], 0.0),
            np.where(fails, missed.angle[chosen], 0.0),
        )
        return _with(found, left[better], update), least

    def _settle(
        self, q: Array, seen: Array, goal: Array, posture: Array, until: float
    ) -> tuple[Array, Array]:
        """Moves solutions in their null space towards postures, for as long as the tool stays in place."""
        going = np.arange(goal.shape[-1])
        for _ in range(_SETTLE):
            if time.monotonic() > until:
                break
            here, there, towards, chain = taken_of((q, goal, posture, seen), going)
            moved = self._iterate(here, there, _TRACK, _SETTLING * (towards - here), chain)
            closer = _square(moved.q - towards) <= _square(here - towards)
            good = host((moved.worst <= _TOLERANCE) & closer)
            if not good.any():
                break
            kept, index = going[good], np.flatnonzero(good)
            q, seen = put_in((q, seen), kept, taken_of((moved.q, moved.seen), index))
            far = host(_largest(moved.q - here))
            going = going[good & (far >= 1e-4)]
            if not len(going):
                break
        return q, seen

    def _iterate(
        self,
        q: Array,
        goal: Array,
        iterations: int,
        pull: Array | None = None,
        seen: Array | None = None,
        until: float = math.inf,
    ) -> _Reached:
        """Levenberg-Marquardt from ``q (n, N)``; ``pull`` is a step asked of the null space at the start.

        At the time ``until`` (of `time.monotonic`) it ends where it is.

        Returns:
            The joints, within their limits, the chain there, and the largest component of the remaining error
            (m, rad).
        """
        rows = np.arange(goal.shape[-1])
        ended: list[_Reached] = []
        of: list[np.ndarray] = []
        stuck = None
        for k in range(iterations + 1):
            if k or seen is None:
                seen = self.chain.seen(q)
            error = self._error(seen, goal)
            worst = _largest(error)
            if k == iterations or (until < math.inf and time.monotonic() > until):
                break
            if pull is None:
                done = worst <= _TOLERANCE if stuck is None else (worst <= _TOLERANCE) | stuck
                if every(done):
                    break
                if some(done):
                    index, rest = where_true(done), where_true(~done)
                    ended.append(_Reached(*taken_of((q, seen, worst), index)))
                    of.append(rows[index])
                    rows = rows[rest]
                    q, seen, goal, error = taken_of((q, seen, goal, error), rest)
            q, stuck = self._moved(q, seen, error, pull)
            pull = None
        ended.append(_Reached(q, seen, worst))
        of.append(rows)
        return _Reached(*joined(ended, of))

    def _moved(self, q: Array, seen: Array, error: Array, pull: Array | None) -> tuple[Array, Array | None]:
        """Joints one step on, and which rows ``(N,)`` get nowhere any more; those stay as they are."""
        xp = array_namespace(q)
        jacobian = self.chain.jacobian(seen)
        if self._asked is not None:
            jacobian = xp.take(jacobian, indices(self._asked, q), axis=1)
        jacobian = jacobian * self._weights
        error = error * self._weights
        damping = 0.5 * total(error * error) + _DAMPING
        step = self._step(jacobian, error, damping, pull)
        largest = _largest(step)
        kept = q + step * (_LONGEST / at_least(largest, _LONGEST))
        stuck = None if pull is not None else largest < _STUCK
        past = (kept < self._lower) | (kept > self._upper)
        if some(past):
            index = where_true(either(past))
            here, turn, way, damp = taken_of((q, jacobian, error, damping), index)
            z = xp.zeros_like(here) if pull is None else taken(pull, index)
            held = self._saturate(here, turn, way, damp, z)
            kept = put(kept, index, held)
            if stuck is not None:
                stuck = put(stuck, index, _largest(held - here) < _STUCK)
        if stuck is not None:
            kept = xp.where(stuck, q, kept)
        return kept, stuck

    def _step(self, jacobian: Array, error: Array, damping: Array, pull: Array | None) -> Array:
        """Damped least squares with a null-space step: ``z + J^T (J J^T + damping)^-1 (e - J z)``."""
        square = total(jacobian[:, :, None, ...] * jacobian[:, None, :, ...]) + damping * self._eye
        if pull is None:
            return _along(jacobian, solve_symmetric(square, error))
        return pull + _along(jacobian, solve_symmetric(square, error - total(jacobian * pull[:, None, ...])))

    def _saturate(self, q: Array, jacobian: Array, error: Array, damping: Array, pull: Array) -> Array:
        """The step's result within the limits: joints that pass one are set on it, the worst first."""
        xp = array_namespace(q)
        free, step = xp.ones_like(q), xp.zeros_like(q)
        joint = indices(np.arange(self._n)[:, None], q)
        for _ in range(self._n):
            held = step * (1.0 - free)
            left = error - total(jacobian * held[:, None, ...])
            moved = self._step(jacobian * free[:, None, ...], left, damping, pull * free) * free
            moved = moved * (_LONGEST / at_least(_largest(moved), _LONGEST))
            step = moved + held
            excess = xp.where(
                free > 0.0, xp.maximum(q + step - self._upper, self._lower - q - step), xp.zeros_like(q)
            )
            worst = joint == xp.argmax(excess, axis=0)
            sets = worst & (excess > 0.0)
            if not some(sets):
                break
            limit = xp.where(step > 0.0, self._upper - q, self._lower - q)
            step, free = xp.where(sets, limit, step), xp.where(sets, xp.zeros_like(free), free)
        return xp.minimum(xp.maximum(q + step, self._lower), self._upper)

    def _error(self, seen: Array, goal: Array) -> Array:
        """What is left of the way in the components that are asked for ``(m, N)``, m and rad."""
        way = difference(seen[0, ...], goal)
        return way if self._asked is None else chosen(way, self._asked)

    def _missed(self, seen: Array, goal: Array) -> _Missed:
        """How far the tool is from its placements."""
        xp = array_namespace(goal)
        way = difference(seen[0, ...], goal) * self._counted
        square = way * way
        weighed = self._error(seen, goal) * self._weights
        return _Missed(
            host(xp.sqrt(total(square[:3, ...]))),
            host(xp.sqrt(total(square[3:, ...]))),
            host(total(weighed * weighed)),
        )


def _with(found: Postures, rows: np.ndarray, other: Postures) -> Postures:
    """What was found, with other values for some rows."""
    return Postures(*put_in(found, rows, other))


def _along(jacobian: Array, force: Array) -> Array:
    """``J^T y (n, N)`` of a transposed Jacobian ``(n, m, N)`` and ``y (m, N)``."""
    terms = jacobian * force
    out = terms[:, 0, ...]
    for i in range(1, force.shape[0]):
        out = out + terms[:, i, ...]
    return out


def _largest(values: Array) -> Array:
    """Largest magnitude ``(N,)`` of values ``(k, N)``."""
    return highest(abs(values))


def _square(values: Array) -> Array:
    """Sums of squares ``(N,)`` of values ``(k, N)``."""
    return total(values * values)
