"""The way of a pusher: to where it stands behind a thing, along with that, and away from it, in one world."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from bt_tasksim.concept_nodes.closer import CLOSER, TOUCHING
from bt_tasksim.concept_nodes.pusher import Stance, stances, tops
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.hand_collision import HandCollisions
from bt_tasksim.planning.route import Pace, Route, followed
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.planning.things import Held, Leave
from bt_tasksim.planning.ways import WayFinder

GAP = 0.02
"""Metres between the pusher and the thing before it begins, as far as is known."""
ABOVE = 0.10
"""Metres above that at which the tool comes straight down, where there is room for it."""
COMING = Pace(0.4)
"""How fast the tool comes there."""
RETREATS = ((0.03, 0.10), (0.015, 0.10), (0.03, 0.04), (0.015, 0.02), (0.0, 0.04), (0.0, 0.0))
"""Metres back, and then up, by which the pusher leaves what it has moved; the first ones that are clear."""
SHORT = (0.0, 0.4, 0.8)
"""Shares of the tolerance by which the way may end too early where the arm reaches no farther."""
UP = np.array([0.0, 0.0, 1.0])
APART = 0.02
"""Metres between places on a thing's way at which it is looked at."""
FINE, FINEST = 0.005, 0.0005
"""The same where it is asked where it meets something; and how exactly that is said."""
RAISED, SEARCHED = 0.05, 2
"""Metres by which a way over things goes higher than its ends; and to how many stances a way is searched for
where none comes there straight."""


class ShovedWay(NamedTuple):
    """How a pusher moves a thing.

    Attributes:
        stance: How it stands behind that.
        route: The tool's way to a little behind there.
        short: Metres by which the thing's way ends before its goal.
        away: Metres ``(2,)`` that the pusher goes back, and up, at the end.
        above: It presses on the thing from above, and the tool's way ends a little over it.
    """

    stance: Stance
    route: Route
    short: float
    away: tuple[float, float]
    above: bool = False


def shoved_way(view: WorldView, target: str, goal: Array, held: str | None, slack: float) -> ShovedWay:
    """The first stance that the arm reaches, and in which nothing is in the way.

    Args:
        view: The world.
        target: The thing.
        goal: Where its middle is to go ``(3,)``, at the height where it is.
        held: What it is pushed with, if not with the hand.
        slack: Metres by which it may be too little.

    Raises:
        NoWayError: There is none; says why not the best.
    """
    way = goal - view.objects[target][:3]
    length = float(np.linalg.norm(way))
    along = np.round(way / max(length, 1e-9), 9)
    check_clear(view, target, goal, held)
    approaches = (
        _Approach(view, target, stance, along, held) for stance in stances(view, target, along, held)
    )
    found = _first(approaches, length, slack)
    if found is None:
        raise NoWayError(f"there is nothing of {target} for {held or 'the hand'} to stand behind")
    return found


def _first(approaches: Iterable[_Approach], length: float, slack: float) -> ShovedWay | None:
    """The first one that serves; where none is reached by straight ways, one is searched for to few of them.

    Raises:
        NoWayError: None serves; says why not the best.
    """
    reason: NoWayError | None = None
    hidden = list[_Approach]()
    for approach in approaches:
        try:
            return approach.way(length, slack, approach.straight())
        except NotStraightError as error:
            reason = reason or error.with_traceback(None)
            hidden.append(approach)
        except NoWayError as error:
            reason = reason or error.with_traceback(None)
    for approach in hidden[:SEARCHED]:
        with suppress(NoWayError):
            return approach.way(length, slack, approach.searched())
    if reason is not None:
        raise reason
    return None


class NotStraightError(NoWayError):
    """The arm can be there, and does not come there by straight ways."""


def touching_now(view: WorldView, target: str) -> frozenset[str]:
    """Names of what a thing touches where it is, or seems to: what it stands on, and what leans on it."""
    here = view.objects[target]
    collisions = _flying(view, target, frozenset(), without=(target,), closer=0.5)
    return frozenset(name for _, name in collisions.touches(here))


def free_until(view: WorldView, target: str, down: Array, way: Array) -> float:
    """Share of a way up to which a thing touches nothing that it does not touch now; 1 where it is free.

    Args:
        view: The world.
        target: The thing.
        down: Displacement ``(3,)`` to where its way begins.
        way: Displacement ``(3,)`` along it.
    """
    collisions = _flying(view, target, frozenset(), without=(target,), closer=TOUCHING)
    here = poses.shifted(view.objects[target], down)
    now = {name for _, name in collisions.touches(here)}
    length = float(np.linalg.norm(way))
    count = max(2, int(np.ceil(length / FINE)) + 1)

    def meets(share: float) -> bool:
        return bool({name for _, name in collisions.touches(poses.shifted(here, share * way))} - now)

    met = next((share for share in np.linspace(0.0, 1.0, count).tolist() if meets(share)), None)
    if met is None:
        return 1.0
    free: float = max(met - 1.0 / (count - 1), 0.0)
    while (met - free) * length > FINEST:
        middle = (met + free) / 2
        free, met = (free, middle) if meets(middle) else (middle, met)
    return free


def _flying(
    view: WorldView, target: str, leave: frozenset[str], without: tuple[str, ...], closer: float
) -> HandCollisions:
    """A thing alone among others, asked about by its own pose."""
    held = Held(target, poses.pose(np.zeros(3)), pieces_of(view.model(target)))
    things = view.things(without, closer)
    return HandCollisions(bodies_of(view.robot), None, things, held, Leave(held=leave))


def check_clear(view: WorldView, target: str, goal: Array, held: str | None) -> None:
    """Nothing is in a thing's way.

    Raises:
        NoWayError: Something is.
    """
    here, leave = view.objects[target], touching_now(view, target)
    without = (target,) if held is None else (target, held)
    collisions = _flying(view, target, leave, without, TOUCHING)
    count = max(2, int(np.ceil(np.linalg.norm(goal - here[:3]) / APART)) + 1)
    for share in np.linspace(0.0, 1.0, count):
        pose = poses.pose(here[:3] + share * (goal - here[:3]), here[3:])
        touch = collisions.first(pose)
        if touch is not None:
            raise NoWayError(f"{target} would be pushed against {touch[1]}: make room, or push it elsewhere")


def pressed_way(view: WorldView, target: str, goal: Array, slack: float) -> ShovedWay:
    """How fingers that press on a thing's top draw it along; arguments as of `shoved_way`.

    Raises:
        NoWayError: They cannot come there, or not go along with it.
    """
    way = goal - view.objects[target][:3]
    length = float(np.linalg.norm(way))
    along = np.round(way / max(length, 1e-9), 9)
    check_clear(view, target, goal, None)
    approaches = (
        _Approach(view, target, stance, along, None, above=True) for stance in tops(view, target, along)
    )
    found = _first(approaches, length, slack)
    if found is None:
        raise NoWayError(f"{target} is too tall to be drawn along by its top")
    return found


class _Approach:
    """One stance of one pusher in one world."""

    def __init__(
        self,
        view: WorldView,
        target: str,
        stance: Stance,
        along: Array,
        held: str | None,
        above: bool = False,
    ) -> None:
        self._view, self._target, self._stance, self._along, self._name = view, target, stance, along, held
        self._held = None if held is None else view.held(held)
        self._above = above
        self._start = poses.shifted(stance.tool, GAP * UP if above else -GAP * along)

    def straight(self) -> Route:
        """The way to where it begins by straight lines: from above, or over what is around.

        Raises:
            NoWayError: The arm cannot be there; or it does not come there so.
        """
        finder, tool = self._finder(self._view, (), CLOSER), self._view.tool
        if not finder.ends(self._start[None], leans=finder.leanings[-1]).free[0]:
            raise NoWayError(finder.no_end(self._start[None]))
        above = poses.shifted(self._start, ABOVE * UP)
        high = max(float(tool[2]), float(above[2])) + RAISED
        up, over = (np.concatenate([pose[:2], [high], pose[3:]]) for pose in (tool, self._start))
        for way in ([tool, above, self._start], [tool, up, over, self._start], [tool, self._start]):
            found = finder.straight(way, leans=finder.leanings[-1])
            if found is not None:
                return followed(finder.arm, np.concatenate([finder.start[None], found]), COMING)
        raise NotStraightError(f"the hand does not come straight behind {self._target}: make room")

    def searched(self) -> Route:
        """The way to where it begins as a search finds it.

        Raises:
            NoWayError: There is none.
        """
        return self._finder(self._view, (), CLOSER).search(self._start[None], COMING)

    def way(self, length: float, slack: float, coming: Route) -> ShovedWay:
        """The whole of it, for a way to where it begins.

        Raises:
            NoWayError: There is none.
        """
        end, short, pushed = self._pushed(length, slack, coming.joints[-1])
        away = self._away(end, length - short, pushed[-1])
        if away is None:
            raise NoWayError(f"there is no room to draw back from {self._target}")
        return ShovedWay(self._stance, coming, short, away, self._above)

    def _pushed(self, length: float, slack: float, begun: Array) -> tuple[Array, float, Array]:
        passing = self._finder(self._view, (self._target,), CLOSER)
        for share in SHORT:
            short = min(share * slack, length)
            end = poses.shifted(self._stance.tool, (length - short) * self._along)
            joints = passing.straight([self._start, end], start=begun, leans=passing.leanings[-1])
            if joints is not None:
                return end, short, joints
        if not passing.ends(end[None]).free[0]:
            raise NoWayError(passing.no_end(end[None]))
        raise NoWayError(f"the arm cannot follow {self._target} to its goal")

    def _away(self, end: Array, length: float, begun: Array) -> tuple[float, float] | None:
        """How the pusher leaves the thing where it lies then."""
        there = self._view.objects[self._target].copy()
        there[:3] += length * self._along
        view = self._view._replace(objects={**self._view.objects, self._target: there})
        touches = frozenset({self._target})
        finder = self._finder(view, (), TOUCHING, Leave(hand=touches, held=touches))
        for back, up in ((0.0, RETREATS[0][1]), *RETREATS[-2:]) if self._above else RETREATS:
            behind = poses.shifted(end, -back * self._along)
            above = poses.shifted(behind, up * UP)
            if back == up == 0.0 or finder.straight([end, behind, above], start=begun) is not None:
                return back, up
        return None

    def _finder(
        self, view: WorldView, without: tuple[str, ...], closer: float, leave: Leave | None = None
    ) -> WayFinder:
        held = () if self._name is None else (self._name,)
        return view.finder(
            [*without, *held], held=self._held, hand=self._stance.hand, closer=closer, leave=leave
        )
