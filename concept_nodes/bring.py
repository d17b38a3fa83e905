"""Bring: carry a held object through free space to a place, clear of everything on the way."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.demonstrated import position_words, rounded, rounded_points
from bt_tasksim.concept.parameters import (
    Flag,
    Metres,
    MetresPerSecond,
    Newtons,
    ObjectName,
    PlaceName,
    Points,
    Position,
)
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes.carry import Carry, MoveMemory
from bt_tasksim.concept_nodes.closer import BROUGHT, CARRIED, DROPPED, HIGHER, NARROWLY, TOUCHING, with_room
from bt_tasksim.concept_nodes.drops import preferred_options
from bt_tasksim.concept_nodes.grasp_pose import neutral_rotation, place_below, resting_place
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT
from bt_tasksim.concept_nodes.spots import GAP, Spots, spots_beside, spots_on
from bt_tasksim.concept_nodes.standing import (
    aside_options,
    supports_of,
    tipped,
)
from bt_tasksim.concept_nodes.surface import top_frame, upright
from bt_tasksim.concept_nodes.view import WorldView, host_numbers, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.fact_arrays import ObjectFacts, take_rows
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.planning.arm import FULL, LEANS, SET_DOWN, arm_of
from bt_tasksim.planning.reference_motion import plan
from bt_tasksim.planning.route import Pace, Route, followed
from bt_tasksim.planning.routes import EVERY, SAMPLES, in_postures, joints_along, with_routes
from bt_tasksim.planning.things import Leave
from bt_tasksim.robot.kinematics.hand import opened_about, wide_at

HOVERS = (0.03, 0.12)
"""Metres between which the height lies that is taken over from a demonstration."""
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
SPOT_ROOMS = (CARRIED, CARRIED), (CARRIED, BROUGHT), (BROUGHT, BROUGHT), (BROUGHT, TOUCHING)
"""The same two closenesses over and on free spots, for all of which one is tried before the next."""
LOWER = (1.0, 0.4, 0.15)
"""Shares of the hover that are tried, the next one where there is no room or no reach for the one before."""
BLENDS = (0.04, 0.02, 0.005)
"""Metres from a corner of a way at which it may begin to be rounded, tried one after the other."""
BRISK = 2.5
"""How much harder than on a way that was searched for the tool may be accelerated on straight lines."""
POSTURES = 3
"""Postures from which it is tried whether something can be put down on a free spot."""
ENDS = 4
"""How many free spots a way may end over."""
LONG_TURN = 2.3
"""Radians of turn from which it matters which way round the hand goes."""


@register("concept")
class Bring(Carry):
    """Carry a held object to a place or a position (keeps free space: NC).

    The object ends ``hover`` above the place (above the rim of a bin), over the place's origin and with its
    heading, up to the object's symmetry; with ``anywhere`` over a free spot of the place, and with ``beside``
    over one next to another object, on what that stands on, whichever the arm can put it on. The way goes
    through ``via`` where it is given and clear; else straight where that is clear of furniture and of other
    objects, for the arm and for what it holds; else it is searched for.

    Args:
        target: The held object.
        to: The place, or another object to bring it above.
        position: Where the object's centre ends, robot base frame; instead of ``to``.
        anywhere: Any free spot on the place will do.
        beside: An object next to which a free spot is to be found; instead of ``to``.
        gap: How far apart the two are then; where there is no room for that, less or more.
        via: Positions of the object's centre on the way, relative to the destination, base-frame axes.
        hover: Free height that remains under the object.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    to: PlaceName | None = None
    position: Position | None = None
    anywhere: Flag = False
    beside: ObjectName | None = None
    gap: Metres = GAP
    via: Points = ()
    hover: Metres = 0.06
    speed: MetresPerSecond = 0.5
    force_limit: Newtons = FORCE_LIMIT

    establishes = (
        ConditionOf("Over", target="target", place="to", anywhere="anywhere"),
        ConditionOf("OverBeside", target="target", other="beside"),
    )
    requires = (ConditionOf("Lifted", target="target"),)
    contact = ContactChange(ContactState.NC, ContactState.NC)
    presentation = Presentation(
        colour="#b07d22",
        spoken=r"bring|carr(?:y|ies)|mov(?:e|ing)|transport|take .* (?:to|over)\b|over to",
        sayings=("I carry the {} over", "bring it to the {}", "now I move it to the {}"),
        says_destination=True,
    )
    default_timeout = 15.0
    default_tolerance = 0.01

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Where to, and over how many via-points."""
        said = [f"to {parameters['to']}"] if "to" in parameters else []
        said += [f"beside {parameters['beside']}"] if "beside" in parameters else []
        if "position" in parameters:
            said.append(f"to {position_words(parameters['position'])}")
        if "via" in parameters:
            count = len(parameters["via"])
            said.append(f"{count} via-point{'' if count == 1 else 's'}" if count else "straight")
        return ", ".join(said)

    @classmethod
    def from_task(cls, task: Task, later: Sequence[Task]) -> dict[str, Any]:
        """Destination and via-points; it ends as high as the place after it began."""
        given = task.parameters
        out: dict[str, Any] = {"target": given["target"]}
        if given.get("to"):
            out["to"] = given["to"]
        else:
            out["position"] = tuple(rounded(v) for v in given["position"])
        out["via"] = rounded_points(given.get("via", ()))
        for other in later:
            if other.concept == "place" and other.parameters["target"] == given["target"]:
                out["hover"] = rounded(np.clip(other.parameters["distance"], *HOVERS))
                break
        return out

    def contradiction(self) -> str:
        """One destination, neither none nor several."""
        if sum(value is not None for value in (self.to, self.position, self.beside)) != 1:
            return "give either 'to', 'position' or 'beside'"
        return "'anywhere' goes with 'to', a place" if self.anywhere and self.to is None else ""

    def begin(self, seen: Seen) -> MoveMemory:
        """Find the way.

        Raises:
            NoWayError: There is none in one of the worlds.
        """
        now = seen.object(self.target)
        found = views(seen)
        chosen = [self._chosen(view) for view in found] if self._chooses else []
        if chosen:
            goal = constant(np.array([ends.options[0] for ends in chosen if ends.options is not None]), now)
            origin = goal[:, :3]
        else:
            goal, origin = self._goal(seen, now)
        grip = poses.relative(now, seen.tool)
        tool_goal = poses.multiply(goal, grip)
        middle, turns = _by_neutral(seen, tool_goal)
        via = self._via(now, goal, origin, grip)
        arrays = [tool_goal, goal[:, 2] - self.hover, middle, turns, *self._exits(seen), *via]
        goals, floors, middles, turned, outs, intos, *vias = host_numbers(arrays)
        put_down, later = self._put_down(seen), self._later(seen)
        ways: list[list[Array]] = []
        routes: dict[int, list[Route]] = {}
        for k, view in enumerate(found):
            if chosen:
                ends = chosen[k]._replace(first=goals[k])
            else:
                supports = supports_of(view, self.to) if self.to is not None else frozenset()
                floor = float(floors[k]) if put_down else None
                options = self._options(view, later)
                aside = None
                if self.to is not None and options is not None and put_down:
                    aside = aside_options(view, self.to, options, held=True)
                ends = self._emptier(view, _Goals(goals[k], options, floor, supports, aside))
            turn = middles[k] if bool(turned[k]) else None
            way, route = _found(
                view,
                self.target,
                ends,
                self.speed,
                _Proposed([v[k] for v in vias], turn, (outs[k], intos[k])),
            )
            if route is not None:
                routes[k] = [route]
            ways.append(way)
        most = max(len(way) for way in ways)
        padded = np.array([[*way, *[way[-1]] * (most - len(way))] for way in ways])
        points = [constant(padded[:, k], tool_goal) for k in range(most)]
        path = plan(points, self.speed, blend=0.04, samples=SAMPLES)
        path = with_routes(path, routes, len(seen.robot.arm_joints))
        straight = {k: view.arm for k, view in enumerate(found) if k not in routes}
        return MoveMemory(in_postures(path, joints_along(path, arm_of(seen.robot), straight)))

    def aim(self, view: WorldView) -> Aim | None:
        """Above its destination."""
        if self._chooses:
            spots = self._spots(view)
            return Aim(_over(spots, self.hover)[spots.few], f"be brought {self._where}", on_the_way=True)
        options = self._options(view)
        if options is None or self.to is None:
            return None
        aside = aside_options(view, self.to, options)
        return Aim(options, f"be brought to {self.to}", on_the_way=True, aside=aside)

    @property
    def _chooses(self) -> bool:
        """It looks for a free spot."""
        return self.anywhere or self.beside is not None

    @property
    def _where(self) -> str:
        return f"beside {self.beside}" if self.beside is not None else f"anywhere onto {self.to}"

    def _spots(self, view: WorldView) -> Spots:
        if self.beside is not None:
            return spots_beside(view, self.target, self.beside, self.gap)
        assert self.to is not None
        return spots_on(view, self.target, self.to)

    def _chosen(self, view: WorldView) -> _Goals:
        """Free spots over which the way may end, and on which the arm can put the object from there.

        Raises:
            NoWayError: There is none.
        """
        spots = self._spots(view)
        over = np.concatenate([_over(spots, share * self.hover) for share in LOWER])
        tools = poses.multiply(over, poses.relative(view.objects[self.target], view.tool)[None])
        goals = _Goals(tools[0], None, float(spots.poses[0, 2]), spots.supports)
        ways = [_Way(view, self.target, goals, Pace(self.speed), *closer) for closer in SPOT_ROOMS]
        reached = ways[-1].reached(tools, len(spots.poses))
        for way in ways:
            serving = (k for k, tool in enumerate(tools) if reached(k) and way.serves(tool))
            good = list(itertools.islice(serving, ENDS))
            if good:
                return goals._replace(first=tools[good[0]], options=over[good])
        raise NoWayError(
            f"the arm can put {self.target} down on none of {len(spots.poses)} free spots {self._where}: "
            f"bring things nearer, or make room"
        )

    def _put_down(self, seen: Seen) -> bool:
        """Whether it is going to be put down where it is brought to."""
        after = next((model for model in seen.later if getattr(model, "actor", None) == self.target), None)
        return after is not None and self.to is not None and after.values.get("on") == self.to

    def _options(self, view: WorldView, later: Sequence[str] = ()) -> Array | None:
        """Poses ``(k, 7)`` in which the object may end; None where it may end in one alone.

        Args:
            view: The world.
            later: Objects that go there, too, after it.
        """
        if self.to is None:
            return None
        heights = [share * self.hover for share in LOWER]
        return np.concatenate([preferred_options(view, self.target, self.to, h, later) for h in heights])

    def _later(self, seen: Seen) -> list[str]:
        """Objects that the tree brings to the same place, after this one."""
        found = [getattr(model, "actor", None) for model in seen.later if model.values.get("to") == self.to]
        return [name for name in dict.fromkeys(found) if name is not None and name != self.target]

    def _emptier(self, view: WorldView, goals: _Goals) -> _Goals:
        """Low over the emptiest part of a container with something in it: what falls far bounces off."""
        place = None if self.to is None else view.world.places.get(self.to)
        if goals.options is None or place is None or place.kind != "bin":
            return goals
        middle = poses.transform(np.asarray(place.pose), np.array([*place.centre, 0.0]))[:2]
        if np.linalg.norm(goals.options[0, :2] - middle) < 1e-6:
            return goals
        grip = poses.relative(view.objects[self.target], view.tool)
        lowest = goals.options[np.argsort(np.round(goals.options[:, 2], 6), kind="stable")]
        return goals._replace(first=poses.multiply(lowest[0], grip), options=lowest)

    def _goal(self, seen: Seen, now: Array) -> tuple[Array, Array]:
        """Poses ``(N, 7)`` of the object at the end, and the destination's origin that ``via`` refers to."""
        xp = array_namespace(now)
        if self.position is not None:
            origin = xp.zeros_like(now[:, :3]) + constant(self.position, now)
            return xp.concat([origin, now[:, 3:]], axis=-1), origin
        assert self.to is not None
        frame, rim = destination(seen, self.to)
        grip = poses.quat_multiply(poses.quat_conjugate(now[:, 3:]), seen.tool[:, 3:])
        neutral = neutral_rotation(seen, poses.z_axis(seen.tool[:, 3:]), frame[:, :3])
        easiest = poses.quat_multiply(neutral, poses.quat_conjugate(grip))
        goal = standing_pose(frame, now, seen.model(self.target), rim + self.hover, easiest)
        return goal, frame[:, :3]

    def _via(self, now: Array, goal: Array, origin: Array, grip: Array) -> list[Array]:
        """Tool poses at the via-points, turned evenly from one to the next."""
        xp, out = array_namespace(now), []
        for k, via in enumerate(self.via):
            share = xp.zeros_like(now[:, 0]) + (k + 1) / (len(self.via) + 1)
            turned = poses.interpolate(now, goal, share)[:, 3:]
            out.append(poses.multiply(xp.concat([origin + constant(via, now), turned], axis=-1), grip))
        return out

    def _exits(self, seen: Seen) -> tuple[Array, Array]:
        """Displacements ``(N, 3)`` that take the tool out of what it starts in, and out of where it ends."""
        xp = array_namespace(seen.tool)
        stands, below = resting_place(seen, self.target), place_below(seen, self.target)
        nothing = xp.zeros_like(seen.tool[:, :3])
        out = xp.where(below.found[:, None], below.place.clearance[:, None] * below.place.exit, nothing)
        out = xp.where(stands.found[:, None], stands.place.clearance[:, None] * stands.place.exit, out)
        if self.to is None or self.to not in seen.world.place_columns:
            return out, nothing
        goal = seen.place(self.to)
        return out, xp.where(goal.container[:, None], nothing, goal.clearance[:, None] * goal.exit)


def _over(spots: Spots, hover: float) -> Array:
    """Poses ``(k, 7)`` so many metres over spots, and over what is around them."""
    found: Array = spots.poses.copy()
    found[:, 2] += spots.rims + hover
    return found


class _Goals(NamedTuple):
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


class _Proposed(NamedTuple):
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


def _found(
    view: WorldView, target: str, goals: _Goals, speed: float, proposed: _Proposed
) -> tuple[list[Array], Route | None]:
    """Tool poses ``(7,)`` of a straight way, or the ends of one that was searched for, and that one.

    Where things stand so close that nothing leads there with the usual room around, less will do, slowly.

    Raises:
        NoWayError: There is no way.
    """
    few = len(view.arm) < FULL
    leaning = None if few else _leaning(view, target, goals)

    grip = poses.relative(view.objects[target], view.tool)

    def find(room: tuple[_Goals, float, float, float, float, float]) -> tuple[list[Array], Route | None]:
        ends, closer, share, down, above, leans = room
        pace = Pace(share * speed)
        pace = pace._replace(acceleration=share**2 * pace.acceleration)
        way = _Way(view, target, ends, pace, closer, down, above, leans)
        straight = way.straight(proposed)
        if straight is not None and proposed.via and share == 1.0:
            return straight, None
        rounded = None if straight is None else way.rounded(straight)
        return [view.tool, ends.first], way.searched() if rounded is None else rounded

    tried = [(goals, *room, LEANS) for room in ROOMS]
    if goals.aside is not None and len(goals.aside):
        aside = goals._replace(first=poses.multiply(goals.aside[0], grip), options=goals.aside)
        tried += [(aside, *room, LEANS) for room in BESIDE]
    if few:
        tried += [(goals, *room, SET_DOWN) for room in SLANTED]
    elif leaning is not None:
        tried += [(leaning, *room, SET_DOWN) for room in TIPPING]
    if goals.floor is not None:
        tried += [(goals, *room, LEANS) for room in FROM_HIGHER]
    return with_room(tried, find)


def _leaning(view: WorldView, target: str, goals: _Goals) -> _Goals | None:
    """The same goals with the object leaning in them; None where it may end in one pose alone."""
    if goals.options is None:
        return None
    grip = poses.relative(view.objects[target], view.tool)
    leaning = tipped(goals.options, grip)
    return goals._replace(first=poses.multiply(leaning[0], grip), options=leaning)


class _Way:
    """The way of a held object in one world."""

    def __init__(
        self,
        view: WorldView,
        target: str,
        goals: _Goals,
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

    def straight(self, proposed: _Proposed) -> list[Array] | None:
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


def _by_neutral(seen: Seen, goal: Array) -> tuple[Array, Array]:
    """The poses ``(N, 7)`` half way of the longer turn, and booleans ``(N,)``: it is the one to take.

    Turned by nearly half a turn, the shorter way may be the one that the arm cannot go, since it leads the
    hand round by its hindmost orientation.
    """
    start = seen.tool
    xp = array_namespace(start)
    far = poses.angle_between(start[:, 3:], goal[:, 3:]) >= LONG_TURN
    middle = poses.interpolate(start, goal, 0.5 + xp.zeros_like(start[:, 0]))
    neutral = neutral_rotation(seen, poses.z_axis(middle[:, 3:]), middle[:, :3])
    hindmost = poses.angle_between(neutral, middle[:, 3:]) > math.pi / 2
    turned = poses.quat_multiply(middle[:, 3:], constant([0.0, 0.0, 0.0, 1.0], middle))
    return xp.concat([middle[:, :3], turned], axis=-1), far & hindmost


def destination(seen: Seen, name: str) -> tuple[Array, Array]:
    """Frames ``(N, 7)`` of a place or of the top of an object, and their rims' heights ``(N,)`` in metres."""
    if name in seen.world.place_columns:
        place = seen.place(name)
        return place.pose, place.rim
    frame = top_frame(seen.object(name), seen.model(name).standing_height)
    return frame, array_namespace(frame).zeros_like(frame[:, 0])


def standing_pose(
    frame: Array, now: Array, model: ObjectFacts, height: Array | float = 0.0, towards: Array | None = None
) -> Array:
    """Poses ``(N, 7)`` of an object that stands above a frame, turned as its symmetry allows.

    Args:
        frame: Poses ``(N, 7)`` of the place.
        now: Present poses ``(N, 7)`` of the object.
        model: The object.
        height: Free height below it, metres, one for all or ``(N,)``.
        towards: Rotations ``(N, 4)`` of the object that are preferred; by default the present ones.
    """
    towards = now[:, 3:] if towards is None else towards
    xp = array_namespace(now)
    centre = model.standing_height + height
    nothing = xp.zeros_like(centre)
    position = poses.transform(frame, xp.stack([nothing, nothing, centre], axis=-1))
    nearest = _nearest_rotation(frame[:, 3:], model, towards)
    best = xp.where(model.revolved[:, None], upright(frame, now), nearest)
    return xp.concat([position, best], axis=-1)


def _nearest_rotation(frame: Array, model: ObjectFacts, towards: Array) -> Array:
    """Of the rotations ``(N, 4)`` in which an object looks the same, the one that is the shortest turn away.

    Of equal ones it is the first.
    """
    xp = array_namespace(towards)
    ways = poses.quat_multiply(frame[:, None, :], model.rotations)
    # Alike as rotations where q and -q are: the larger |q . r|, the shorter the turn.
    nearness = abs(poses.dot(ways, towards[:, None, :]))
    counts = xp.where(model.rotation_counts, xp.round(nearness * 1e9), -xp.ones_like(nearness))
    return take_rows(ways, xp.argmax(counts, axis=1))
