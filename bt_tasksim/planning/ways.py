"""Ways for an arm and what its hand holds, clear of everything that is known to be around.

A straight way of the tool is taken where it is clear, for it is what people expect and costs next to nothing;
else one by given poses on the way, such as out of a shelf and into another one; else one that is searched for
in the space of the arm's joints (`bt_tasksim.planning.search`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.arm import FULL, LEANS, SWAYS, arm_of
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.collision import OWN, Collisions, beyond, bounds
from bt_tasksim.planning.lines import STEP, line
from bt_tasksim.planning.route import Pace, Route, timed
from bt_tasksim.planning.search import Search
from bt_tasksim.planning.things import Held, Leave, Thing, Touch, inner, told_apart
from bt_tasksim.robot.description import RobotDescription

_TURNING = 0.2
"""Radians between poses of a straight way at which joints are computed."""
FINER = 0.25
"""Share of a search's steps at which its way is looked at in the end, and at which it is searched for once
more if something is touched there: margins are less than an outstretched arm moves in one step."""
CLOSELY = 0.01
"""An arm with too few joints to follow any line is asked every so many metres whether it does."""
LEAVING = 0.25
"""Radians of any joint from where a way begins within which it may be as close to things as there."""
LESS = (0.7, 0.4, 0.2)
"""Shares of their margins that are tried for things within whose margins a way begins."""
_UNLIKE = 0.2
"""Radians by which postures at one pose differ to be worth trying both."""
_LEANING = 0.5
"""Radians by which what is held may lean more on its way than at its ends."""


class Ends(NamedTuple):
    """Postures at poses that were asked for.

    Attributes:
        joints: ``(k, n_arm)``.
        reached: Booleans ``(k,)``: they bring the tool there.
        free: Booleans ``(k,)``: they do, and nothing is touched.
    """

    joints: Array
    reached: Array
    free: Array


class WayFinder:
    """Ways of one arm in one world, as everything stands at one moment.

    What is touched at the beginning already may be left on the way, since that is how things are: nothing
    else would find a way out. It counts at the end.

    Args:
        robot: The robot.
        joints: The arm's ``(n_arm,)``, where the way begins.
        hand: The hand's ``(n_hand,)`` on the way.
        things: What to keep clear of.
        held: What is in the hand.
        leave: What may touch.
        own: Metres that the robot's own bodies keep from each other.
    """

    def __init__(
        self,
        robot: RobotDescription,
        joints: Array,
        hand: Array,
        things: Sequence[Thing],
        held: Held | None = None,
        leave: Leave | None = None,
        own: float = OWN,
    ) -> None:
        self.arm = arm_of(robot)
        self.start = np.clip(joints, robot.arm_lower, robot.arm_upper)
        self._robot, self._held, self._own = robot, held, own
        self._hand, self._things, self._leave = hand, told_apart(things), leave or Leave()
        self._workspace = bounds(robot, self.arm.tool(self.start))

    @property
    def hand(self) -> Array:
        """The hand's joints ``(n_hand,)`` on the way."""
        return self._hand

    @property
    def goes_straight(self) -> bool:
        """The arm has the joints to follow any line, turning as it likes."""
        return len(self.start) >= FULL

    @property
    def leanings(self) -> tuple[float, ...]:
        """How far in radians the tool may lean where it is on its way, what is best first."""
        return (LEANS,) if self.goes_straight else (LEANS, SWAYS)

    @cached_property
    def collisions(self) -> Collisions:
        """What counts at the end."""
        return self._among(self._things)

    @cached_property
    def on_the_way(self) -> Collisions:
        """What counts on the way: of what touches at the beginning less margin, or else nothing."""
        if self.collisions.free(self.start):
            return self.collisions
        near = {key for touch in self.collisions.keys(self.start) for key in touch}

        def less(share: float) -> list[Thing]:
            return [_with(thing, share) if thing.known_as in near else thing for thing in self._things]

        none = self._among(less(0.0))
        for share in LESS if none.free(self.start) else ():  # else it is not with more room either
            found = self._among(less(share))
            if found.free(self.start):
                return found
        return self._left(less(0.0), none)

    @cached_property
    def _rooms(self) -> list[Collisions | _Leaving]:
        """What counts on the way: less than usual near its beginning; where none leads on then, all along."""
        if self.on_the_way is self.collisions:
            return [self.collisions]
        return [_Leaving(self.collisions, self.on_the_way, self.start), self.on_the_way]

    @cached_property
    def _without_margins(self) -> Collisions:
        """What must not happen between two questions either: that something is touched."""
        things = [_with(thing, 0.0) for thing in self._things]
        return self._left(things, self._among(things))

    def _left(self, things: Sequence[Thing], found: Collisions) -> Collisions:
        """Collisions among things; what touches at the beginning is left, and nobody goes through it.

        Args:
            things: The things.
            found: Collisions among them, with nothing left.
        """
        if found.free(self.start):
            return found
        touches = found.keys(self.start)
        near = {key for touch in touches for key in touch}
        within = [*things, *(piece for thing in things if thing.known_as in near for piece in inner(thing))]
        left = self._among(within, touches)
        more = left.keys(self.start)
        return self._among(within, [*touches, *more]) if more else left

    def _among(self, things: Sequence[Thing], pairs: Collection[Touch] = ()) -> Collisions:
        leave = replace(self._leave, pairs={*self._leave.pairs, *pairs})
        bodies = bodies_of(self._robot)
        return Collisions(bodies, self._hand, things, self._held, leave, self._own, self._workspace)

    def ends(self, tools: Array, beginning: Array | None = None, leans: float = LEANS) -> Ends:
        """Postures at tool poses ``(k, 7)``, from where the arm is or from ``beginning (n_arm,)``.

        Args:
            tools: The poses.
            beginning: Where the arm comes from.
            leans: Radians by which an arm of few joints may turn the tool from them.
        """
        begin = self.start if beginning is None else beginning
        found = [self._end(tool, begin, leans) for tool in tools]
        joints = np.array([self.start if q is None else q for q, _ in found])
        reached = np.array([q is not None for q, _ in found], bool)
        return Ends(joints, reached, np.array([free for _, free in found], bool))

    def _end(self, tool: Array, begin: Array, leans: float) -> tuple[Array | None, bool]:
        """A posture at a tool pose, one that touches nothing if there is such among those that are tried."""
        touching = None
        for q, free in self._tried(tool, begin, leans):
            if free:
                return q, True
            touching = q if touching is None else touching
        return touching, False

    def postures(self, tool: Array, leans: float = LEANS) -> Iterator[Array]:
        """Postures ``(n_arm,)`` at a tool pose ``(7,)`` in which nothing is touched, unlike ones."""
        found: list[Array] = []
        for q, free in self._tried(tool, self.start, leans):
            if free and all(float(np.abs(q - other).max()) > _UNLIKE for other in found):
                found.append(q)
                yield q

    def _tried(self, tool: Array, begin: Array, leans: float) -> Iterator[tuple[Array, bool]]:
        if self.beyond(tool[None])[0] > 0.0:
            return
        for seed in (begin, self._robot.rest, *self.arm.seeds):
            q = self.arm.joints(tool, seed, leans=leans)
            if q is not None:
                yield q, self.collisions.free(q)

    def straight(
        self,
        way: Sequence[Array],
        start: Array | None = None,
        spacing: float = 0.04,
        leans: float = LEANS,
    ) -> Array | None:
        """Joints ``(n, n_arm)`` along straight lines of the tool through poses ``(7,)``, the first included.

        Args:
            way: Poses that the tool goes through; the first one is where it is.
            start: Joints ``(n_arm,)`` there, by default where the arm is.
            spacing: Metres between poses at which joints are computed.
            leans: Radians by which an arm of few joints may turn the tool from the last pose.

        Returns:
            None where the arm cannot follow, or would touch something.
        """
        begin = self.start if start is None else start
        if not self.goes_straight:
            spacing = min(spacing, CLOSELY)
        tools = _spaced(way, spacing)
        joints = self.arm.along(begin, tools, leans)
        if joints is None:
            return None
        return joints if self.clear(np.concatenate([begin[None], joints])) else None

    def clear(self, joints: Array) -> bool:
        """Nothing is touched on the straight lines between postures ``(n, n_arm)``."""
        pieces = [line(a, b, 2 * STEP)[1:] for a, b in itertools.pairwise(joints)]
        postures = np.concatenate(pieces)
        return any(among.all_free(postures) for among in self._rooms)

    def search(self, tools: Array, pace: Pace, seed: int = 1, leans: float = LEANS) -> Route:
        """A way to one of the tool poses ``(k, 7)``, those that come first preferred.

        Args:
            tools: The poses.
            pace: How fast the tool may go.
            seed: Of the search's random numbers.
            leans: As of `ends`.

        Raises:
            NoWayError: There is none, or none was found; says what is in the way, or that it is out of reach.
        """
        found = [q for tool in tools for q in self.postures(tool, leans)]
        if not found:
            raise NoWayError(self.no_end(tools))
        return self.search_posture(np.array(found), pace, seed)

    def search_posture(self, goals: Array, pace: Pace, seed: int = 1) -> Route:
        """A way to one of the postures ``(k, n_arm)``, in which nothing is touched.

        Raises:
            NoWayError: None was found.
        """
        robot = self._robot
        for among in self._rooms:
            allowed = _Allowed(among, self._held, [self.start, *goals])
            for step in (STEP, FINER * STEP):
                search = Search(allowed, robot.arm_lower, robot.arm_upper, robot.rest, seed, step)
                way = search.way(self.start, goals)
                if way is None:
                    break
                route = timed(self.arm, way, pace, among.free)
                if self._without_margins.all_free(_finely(route.joints)):
                    return route
        at = ", ".join(f"{v:.2f}" for v in self.arm.tool(goals[0])[:3])
        raise NoWayError(
            f"no way for the hand to ({at}) m that keeps clear of everything was found: "
            f"make room, or give via-points"
        )

    def touched(self, tool: Array) -> list[Touch]:
        """What would touch with the tool at a pose ``(7,)``; nothing where that is out of reach."""
        end = self.ends(tool[None])
        return self.collisions.touches(end.joints[0]) if end.reached[0] else []

    def beyond(self, tools: Array) -> Array:
        """Metres ``(k,)`` by which tool poses ``(k, 7)`` are outside the robot's workspace, 0 within it."""
        return beyond(self._workspace, tools)

    def unreached(self, tool: Array) -> str:
        """Why the arm does not come to a tool pose ``(7,)``, in few words."""
        outside = self.beyond(tool[None])[0] > 0.0
        return f"outside the workspace of '{self._robot.name}'" if outside else "out of reach"

    def no_end(self, tools: Array) -> str:
        """Why the hand cannot be at any of the tool poses ``(k, 7)``, in one sentence."""
        ends = self.ends(tools)
        at = ", ".join(f"{v:.2f}" for v in tools[0, :3])
        nearest = tools[int(np.argmin(self.beyond(tools)))]
        far = float(self.beyond(nearest[None])[0])
        if far > 0.0 and any(self.arm.joints(nearest, seed) is not None for seed in self.arm.seeds):
            at = ", ".join(f"{v:.2f}" for v in nearest[:3])
            return (
                f"({at}) m is {1000 * far:.0f} mm beyond where the tool may go in the workspace of "
                f"'{self._robot.name}': bring things nearer, or widen 'safety.workspace'"
            )
        if not ends.reached.any():
            return f"the arm does not reach ({at}) m: bring things nearer, or turn them"
        k = int(np.flatnonzero(ends.reached)[0])
        touches = self.collisions.touches(ends.joints[k])
        pair = f"{touches[0][0]} would touch {touches[0][1]}" if touches else "something would be touched"
        return f"at ({at}) m {pair}: make room there"


class _Leaving:
    """Collisions of an arm that begins closer to things than usual, and may be so near there alone."""

    def __init__(self, usual: Collisions, less: Collisions, start: Array) -> None:
        self._usual, self._less, self._start = usual, less, start

    def free(self, q: Array) -> bool:
        """Nothing touches with the arm's joints at ``q (n_arm,)``."""
        if self._usual.free(q):
            return True
        return float(np.abs(q - self._start).max()) < LEAVING and self._less.free(q)

    def all_free(self, postures: Array) -> bool:
        """Nothing touches at any of ``postures (n, n_arm)``."""
        there = np.abs(postures - self._start).max(axis=-1) < LEAVING
        if not self._usual.all_free(postures[~there]):
            return False
        begins = postures[there]
        return self._less.all_free(begins) or all(self.free(q) for q in begins)

    def tool_rotation(self, q: Array) -> Array:
        """See `Collisions.tool_rotation`."""
        return self._usual.tool_rotation(q)


class _Allowed:
    """Nothing touches, and what is held leans little more than at its ends."""

    def __init__(self, collisions: Collisions | _Leaving, held: Held | None, ends: Sequence[Array]) -> None:
        self._collisions, self._up = collisions, None if held is None else _up(held)
        self._most = -1.0
        if self._up is not None:
            leans = [np.arccos(np.clip(self._height(q), -1.0, 1.0)) for q in ends]
            self._most = float(np.cos(min(max(leans) + _LEANING, np.pi)))

    def __call__(self, q: Array) -> bool:
        return self._collisions.free(q) and (self._up is None or self._height(q) >= self._most)

    def _height(self, q: Array) -> float:
        return float((self._collisions.tool_rotation(q) @ self._up)[2])


def _finely(joints: Array) -> Array:
    """Postures ``(m, n_arm)`` on the lines between postures ``(n, n_arm)``, close together."""
    return np.concatenate([line(a, b, FINER * STEP) for a, b in itertools.pairwise(joints)])


def _with(thing: Thing, share: float) -> Thing:
    """The thing with a share of its margin."""
    return replace(thing, margin=share * thing.margin)


def _up(held: Held) -> Array:
    """The held object's upward axis ``(3,)`` in the tool frame."""
    found: Array = poses.z_axis(poses.unit_pose(held.grip)[3:])
    return found


def _spaced(way: Sequence[Array], spacing: float) -> Array:
    """Poses ``(n, 7)`` along lines, without the first one."""
    points = np.array(way)
    turns = poses.angle_between(points[:-1, 3:], points[1:, 3:]).tolist()
    lengths = [float(np.linalg.norm(b[:3] - a[:3])) for a, b in itertools.pairwise(points)]
    counts = [
        max(1, math.ceil(max(length / spacing, turn / _TURNING)))
        for length, turn in zip(lengths, turns, strict=True)
    ]
    shares = np.concatenate([np.linspace(1.0 / n, 1.0, n) for n in counts])
    found: Array = poses.interpolate(
        np.repeat(points[:-1], counts, axis=0), np.repeat(points[1:], counts, axis=0), shares
    )
    return found
