"""The search for a way through the space of an arm's joints, by OMPL.

RRT-Connect (J. Kuffner and S. LaValle, "RRT-Connect: an efficient approach to single-query path planning",
ICRA 2000) finds a way, which is then cut short. The same request gives the same way: its random numbers begin
anew with each search, and it ends after a number of questions, never by the clock.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.planning.lines import STEP, halves, line

RANGE = 0.9
"""Radians that a tree grows by at most."""
QUESTIONS = 4000
"""Questions after which each of the two rounds of a search gives up: some 0.2 s."""
_CUTS = 60
_NEAR = 1.0
"""Radians beyond start, goal and rest that a first search keeps to: so the arm does not swing about."""


_LOCK = threading.RLock()
"""Held by who uses OMPL's random numbers, of which a process has one source."""


class Search:
    """Ways among postures that are allowed.

    Args:
        free: Whether joints ``(n_arm,)`` are allowed.
        lower: Lower limits ``(n_arm,)``.
        upper: Upper limits ``(n_arm,)``.
        rest: A posture ``(n_arm,)`` that ways may go by.
        seed: Of the random numbers.
        step: Radians of the joint that turns most, between two questions on a line.
    """

    def __init__(
        self,
        free: Callable[[Array], bool],
        lower: Array,
        upper: Array,
        rest: Array,
        seed: int = 1,
        step: float = STEP,
    ) -> None:
        self._step = step
        self._free, self._lower, self._upper, self._rest, self._seed = free, lower, upper, rest, seed
        self.asked = 0

    def clear(self, a: Array, b: Array) -> bool:
        """The straight line between two postures is allowed; the ends are taken to be."""
        return all(self._ask(q) for q in halves(line(a, b, self._step)[1:-1]))

    def way(self, start: Array, goals: Array) -> list[Array] | None:
        """Postures from ``start (n_arm,)`` to one of ``goals (k, n_arm)``, joined by allowed lines.

        None where none was found.
        """
        for goal in goals:
            if self.clear(start, goal):
                return [start, goal]
        for near in (True, False):
            found = self._connected(start, goals, near)
            if found is not None:
                return self._cut_short(found)
        return None

    def _ask(self, q: Array) -> bool:
        self.asked += 1
        return bool(self._free(q))

    def _connected(self, start: Array, goals: Array, near: bool) -> list[Array] | None:
        with _ompl(self._seed):
            return self._by_ompl(start, goals, near)

    def _by_ompl(self, start: Array, goals: Array, near: bool) -> list[Array] | None:
        from ompl import base, geometric

        n = len(start)
        ends = np.concatenate([start[None], goals, self._rest[None]])
        low, high = self._lower, self._upper
        if near:
            low = np.maximum(low, ends.min(axis=0) - _NEAR)
            high = np.minimum(high, ends.max(axis=0) + _NEAR)
        space, bounds = base.RealVectorStateSpace(n), base.RealVectorBounds(n)
        for i in range(n):  # the ends themselves may stand on a limit
            bounds.setLow(i, float(low[i]) - 1e-6)
            bounds.setHigh(i, float(high[i]) + 1e-6)
        space.setBounds(bounds)
        setup = geometric.SimpleSetup(space)
        until = self.asked + QUESTIONS

        def valid(state: Any) -> bool:
            return self._ask(np.array([state[i] for i in range(n)]))

        setup.setStateValidityChecker(valid)
        information = setup.getSpaceInformation()
        information.setStateValidityCheckingResolution(self._step / space.getMaximumExtent())
        setup.setStartState(_state(space, start))
        targets = base.GoalStates(information)
        for goal in goals:
            targets.addState(_state(space, goal))
        setup.setGoal(targets)
        planner = geometric.RRTConnect(information)
        planner.setRange(RANGE)
        setup.setPlanner(planner)
        setup.solve(base.PlannerTerminationCondition(lambda: self.asked >= until))
        if not setup.haveExactSolutionPath():
            return None
        path = setup.getSolutionPath()
        return [np.array([path.getState(k)[i] for i in range(n)]) for k in range(path.getStateCount())]

    def _cut_short(self, way: list[Array]) -> list[Array]:
        """The way without its detours: pieces between random points on it, replaced by lines."""
        rng = np.random.default_rng(self._seed)
        for _ in range(_CUTS):
            if len(way) < 3:
                break
            lengths = np.array([np.abs(b - a).max() for a, b in itertools.pairwise(way)])
            along = np.concatenate([[0.0], np.cumsum(lengths)])
            first, last = np.sort(rng.uniform(0.0, along[-1], 2))
            i, j = (int(np.searchsorted(along, s, side="right")) - 1 for s in (first, last))
            i, j = min(i, len(way) - 2), min(j, len(way) - 2)
            if i == j:
                continue
            a, b = (_on(way, along, k, s) for k, s in ((i, first), (j, last)))
            if self.clear(a, b) and self._ask(a) and self._ask(b):
                way = [*way[: i + 1], a, b, *way[j + 1 :]]
        return _without_repeats(way)


@contextmanager
def _ompl(seed: int) -> Iterator[None]:
    """OMPL, silent and with random numbers of this seed, in one thread at a time.

    Its seed and its level of messages are those of the process. Both are given back: the numbers of whoever
    uses OMPL besides go on from a seed drawn from theirs.
    """
    from ompl import util

    with _LOCK:
        level = util.getLogLevel()
        util.setLogLevel(util.LOG_NONE)
        theirs = util.RNG().getLocalSeed()
        util.RNG.setSeed(seed)
        try:
            yield
        finally:
            util.RNG.setSeed(theirs)
            util.setLogLevel(level)


def _on(way: list[Array], along: Array, k: int, s: float) -> Array:
    share = (s - along[k]) / max(float(along[k + 1] - along[k]), 1e-12)
    found: Array = way[k] + share * (way[k + 1] - way[k])
    return found


def _without_repeats(way: list[Array]) -> list[Array]:
    """Without points that lie on the line between their neighbours."""
    kept = [way[0]]
    for k in range(1, len(way) - 1):
        before, after = way[k] - kept[-1], way[k + 1] - kept[-1]
        length = float(np.linalg.norm(after))
        aside = before - after * (float(before @ after) / max(length**2, 1e-12))
        if float(np.linalg.norm(aside)) > 1e-6:
            kept.append(way[k])
    return [*kept, way[-1]]


def _state(space: Any, joints: Array) -> Any:
    state = space.allocState()
    for i, value in enumerate(joints.tolist()):
        state[i] = value
    return state
