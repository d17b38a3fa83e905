"""The way of something that is held to where it ends: straight, by its exits, or as a search finds it.

What is tried, one after the other, is how close to other things it may come, how fast, and how it may lean.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from bt_tasksim.concept_nodes.closer import BROUGHT, CARRIED, DROPPED, HIGHER, NARROWLY, TOUCHING, with_room
from bt_tasksim.concept_nodes.standing import tipped
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.arm import FULL, LEANS, SET_DOWN
from bt_tasksim.planning.reference_motion import plan
from bt_tasksim.planning.route import Pace, Route, followed
from bt_tasksim.planning.routes import EVERY, SAMPLES
from bt_tasksim.planning.things import Leave
from bt_tasksim.robot.kinematics.hand import opened_about, wide_at

RAISED = 0.05
"""Metres by which a way over things goes higher than its ends."""
ENOUGH = 6
"""Postures at the end of a way from which a search may choose."""
SLOW, SLOWER = 0.6, 0.4
"""Shares of the usual speed at which things are carried closely past others: an arm that lags cuts corners
less."""
ROOMS = (
    (CARRIED, 1.0, BROUGHT, 0.0),
    (NARROWLY, SLOW, BROUGHT, 0.0),
    (BROUGHT, SLOWER, BROUGHT, 0.0),
    (BROUGHT, SLOWER, TOUCHING, 0.0),
    (BROUGHT, SLOWER, TOUCHING, DROPPED),
)
"""What is tried one after the other: how much closer than usual one may come to things on the way, the share
of the usual speed, the same closeness where it is put down, and metres above its support where that ends."""
BESIDE = ((BROUGHT, SLOWER, TOUCHING, 0.0),)
"""The same for what is put down a little aside of where it should stand, see `aside_options`."""
SLANTED = (CARRIED, 1.0, BROUGHT, 0.0), (BROUGHT, SLOWER, TOUCHING, 0.0)
"""The same for an arm of few joints where nothing else serves: what has turned in its hand it sets down
slanted."""
TIPPING = ((BROUGHT, SLOWER, TOUCHING, DROPPED),)
"""The same for other arms, which lean it on purpose, see `tipped`."""
FROM_HIGHER = tuple((BROUGHT, SLOWER, TOUCHING, above) for above in HIGHER)
"""The same at last: it falls a little when it is let go."""
BLENDS = (0.04, 0.02, 0.005)
"""Metres from a corner of a way at which it may begin to be rounded, tried one after the other."""
BRISK = 2.5
"""How much harder than on a way that was searched for the tool may be accelerated on straight lines."""
POSTURES = 3
"""Postures from which it is tried whether something can be put down on a free spot."""


class WayEnds(NamedTuple):
    """Where a way may end.

    Attributes:
        first: The tool pose ``(7,)`` that is preferred.
        options: Poses ``(k, 7)`` of the object; None: there is no other.
        floor: Height in metres of the object's middle once it is put down from there; None where it is not.
        supports: Names of what it then touches.
        aside: Other poses ``(m, 7)`` where none of these will do; None: there are none.
    """

    first: Array
    options: Array | None
    floor: float | None
    supports: frozenset[str]
    aside: Array | None = None


class ProposedWay(NamedTuple):
    """What straight ways may go by.

    Attributes:
        via: Poses that the way should go through.
        turn: A pose on the way where the tool should turn by, or None.
        exits: Displacements ``(3,)`` that take the tool out of the fixture it starts in and out of the one it
            ends in.
    """

    via: Sequence[Array]
    turn: Array | None
    exits: tuple[Array, Array]


def way_over(
    view: WorldView, target: str, goals: WayEnds, speed: float, proposed: ProposedWay
) -> tuple[list[Array], Route | None]:
    """Tool poses ``(7,)`` of a straight way, or the ends of one that was searched for, and that one.

    Where things stand so close that nothing leads there with the usual room around, less will do, slowly.

    Raises:
        NoWayError: There is no way.
    """
    grip = poses.relative(view.objects[target], view.tool)

    def find(room: tuple[WayEnds, float, float, float, float, float]) -> tuple[list[Array], Route | None]:
        ends, closer, share, down, above, leans = room
        pace = Pace(share * speed)
        pace = pace._replace(acceleration=share**2 * pace.acceleration)
        way = CarriedWay(view, target, ends, pace, closer, down, above, leans)
        straight = way.straight(proposed)
        if straight is not None and proposed.via and share == 1.0:
            return straight, None
        rounded = None if straight is None else way.rounded(straight)
        return [view.tool, ends.first], way.searched() if rounded is None else rounded

    def tried() -> Iterator[tuple[WayEnds, float, float, float, float, float]]:
        yield from ((goals, *room, LEANS) for room in ROOMS)
        if goals.aside is not None and len(goals.aside):
            aside = goals._replace(first=poses.multiply(goals.aside[0], grip), options=goals.aside)
            yield from ((aside, *room, LEANS) for room in BESIDE)
        if len(view.arm) < FULL:
            yield from ((goals, *room, SET_DOWN) for room in SLANTED)
        elif (leaning := _leaning(view, target, goals)) is not None:
            yield from ((leaning, *room, SET_DOWN) for room in TIPPING)
        if goals.floor is not None:
            yield from ((goals, *room, LEANS) for room in FROM_HIGHER)

    return with_room(tried(), find)


def _leaning(view: WorldView, target: str, goals: WayEnds) -> WayEnds | None:
    """The same goals with the object leaning in them; None where it may end in one pose alone."""
    if goals.options is None:
        return None
    grip = poses.relative(view.objects[target], view.tool)
    leaning = tipped(goals.options, grip)
    return goals._replace(first=poses.multiply(leaning[0], grip), options=leaning)


class CarriedWay:
    """The way of a held object in one world."""

    def __init__(
        self,
        view: WorldView,
        target: str,
        goals: WayEnds,
        pace: Pace,
        closer: float,
        down: float = BROUGHT,
        above: float = 0.0,
        leans: float = LEANS,
    ) -> None:
        self._view, self._pace, self._leans = view, pace, leans
        self._floor = None if goals.floor is None else goals.floor + above
        held = view.held(target)
        self._finder = view.finder([target], held=held, closer=closer)
        leave = Leave(held=goals.supports)
        # Where it is put down the hand opens.
        wide = wide_at(view.robot, float(view.robot.closure(view.hand)))
        opened = opened_about(view.robot, wide)
        self._down = view.finder([target], held=held, leave=leave, closer=down, hand=opened)
        others = np.zeros((0, 7)) if goals.options is None else goals.options
        self._grip = poses.relative(view.objects[target], view.tool)
        self._goals = np.concatenate([goals.first[None], poses.multiply(others, self._grip[None])])

    def straight(self, proposed: ProposedWay) -> list[Array] | None:
        """Tool poses ``(7,)`` joined by straight lines that are clear; None where no such way is."""
        start, goal = self._view.tool, self._goals[0]
        if not self._finder.goes_straight or not self._finder.ends(goal[None]).free[0]:
            return None
        ways = [[start, *proposed.via, goal]] if proposed.via else []
        if proposed.turn is not None:
            ways.append([start, proposed.turn, goal])
        ways += [[start, goal], *_by_exits(start, goal, proposed.exits)]
        for way in ways:
            joints = self._finder.straight(way)
            if joints is not None and self._put_down(goal, joints[-1]):
                return way
        return None

    def rounded(self, way: Sequence[Array]) -> Route | None:
        """The motion along straight lines through tool poses ``(7,)``, rounded; None where that is not clear.

        It is no faster than the joints can follow: a hand that lags behind leaves its way.
        """
        finder, pace = self._finder, self._pace._replace(acceleration=BRISK * self._pace.acceleration)
        for blend in BLENDS:
            path = plan([tool[None] for tool in way], self._pace.speed, blend=blend, samples=SAMPLES)
            joints = finder.arm.along(finder.start, path.table[0, ::EVERY])
            if joints is not None and finder.clear(joints):
                return followed(finder.arm, np.concatenate([finder.start[None], joints]), pace)
        return None

    def searched(self) -> Route:
        """A way that is searched for, to whichever of the goals can be reached.

        Raises:
            NoWayError: There is none.
        """
        good: list[Array] = []
        for leans in self._finder.leanings:
            for goal in () if good else self._goals:
                good += self._postures(goal, leans)
                if len(good) >= ENOUGH:
                    break
        if not good:
            raise NoWayError(self._why_not())
        return self._finder.search_posture(np.array(good), self._pace)

    def reached(self, goals: Array, spots: int) -> Callable[[int], bool]:
        """Which of tool poses ``(k, 7)`` the arm reaches, there and where the object stands below it.

        Args:
            goals: The poses.
            spots: After how many of them they are over the same spots again, only lower.
        """

        @cache
        def stands(spot: int) -> bool:
            return bool(self._down.ends(self._below(goals[spot])[None], leans=self._leans).free[0])

        @cache
        def over(k: int) -> bool:
            widest = self._finder.leanings[-1]
            return bool(self._finder.ends(goals[k][None], leans=widest).free[0])

        return lambda k: stands(k % spots) and over(k)

    def serves(self, goal: Array) -> bool:
        """Whether the object can be at a tool pose ``(7,)``, and be put down from there."""
        return any(next(self._postures(goal, leans), None) is not None for leans in self._finder.leanings)

    def _postures(self, goal: Array, leans: float) -> Iterator[Array]:
        """Postures ``(n_arm,)`` at a tool pose ``(7,)`` from which the object can be put down.

        Where the arm cannot go straight down from where it is easily, it may come straight up from where it
        can be down there.
        """
        some = False
        for joints in itertools.islice(self._finder.postures(goal, leans), POSTURES):
            if self._put_down(goal, joints):
                some = True
                yield joints
        if some or self._floor is None:
            return
        down = self._below(goal)
        for joints in itertools.islice(self._down.postures(down, self._leans), POSTURES):
            up = self._down.straight([down, goal], start=joints, leans=max(leans, self._leans))
            if up is not None and self._finder.collisions.free(up[-1]) and self._put_down(goal, up[-1]):
                yield up[-1]

    def _put_down(self, goal: Array, joints: Array) -> bool:
        """Whether the object can be put down from a tool pose ``(7,)``, the arm at ``joints (n_arm,)``."""
        if self._floor is None:
            return True
        down = self._below(goal)
        if self._down.straight([goal, down], start=joints, leans=self._leans) is None:
            return False
        return bool(self._down.ends(down[None], joints, self._leans).free[0])

    def _below(self, goal: Array) -> Array:
        """The tool pose ``(7,)`` in which the object stands, below one ``(7,)`` in which it is held over."""
        assert self._floor is not None
        held = poses.transform(goal, poses.inverse(self._grip)[:3])
        found: Array = goal - (float(held[2]) - self._floor) * np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
        return found

    def _why_not(self) -> str:
        if self._floor is None or not self._finder.ends(self._goals).free.any():
            return self._finder.no_end(self._goals)
        return self._down.no_end(np.array([self._below(goal) for goal in self._goals]))


def _by_exits(start: Array, goal: Array, exits: tuple[Array, Array]) -> list[list[Array]]:
    """Ways out of and into fixtures along their access, level and raised."""
    out, into = start.copy(), goal.copy()
    out[:3] += exits[0]
    into[:3] += exits[1]
    middle = [p for p, e in ((out, exits[0]), (into, exits[1])) if float(np.abs(e).sum()) > 0]
    high = max(float(p[2]) for p in (start, *middle, goal)) + RAISED
    raised = [np.concatenate([p[:2], [high], p[3:]]) for p in middle or (start, goal)]
    return [[start, *middle, goal], [start, *raised, goal]]
