"""Tipping a held thing over an edge of what it lies or stands on: tip up and lay down.

The edge on that side stays where it is while everything else turns about it, until the face beyond the edge
lies on the surface. Where the arm cannot lead it so, it is turned in the air and set down where it was. It is
kept a hair above the surface, and gives way where it is felt to press.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.closer import CLOSER, TOUCHING, VERY_CLOSE, with_room
from bt_tasksim.concept_nodes.contents import spilling_none
from bt_tasksim.concept_nodes.grasp_pose import half_extent
from bt_tasksim.concept_nodes.holding import HOLDING, may_hold, not_held
from bt_tasksim.concept_nodes.limits import force_at_tool, strain
from bt_tasksim.concept_nodes.standing import headings
from bt_tasksim.concept_nodes.touching import touched
from bt_tasksim.concept_nodes.turning import brought, followed_anyhow, swung, turned_by
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.outcomes import Form, Possible, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.units import NEWTONS, RADIANS, SHARE
from bt_tasksim.core.world import FURNITURE, Command, ObjectModel
from bt_tasksim.planning.reference_motion import Path, at_times, plan, searched_for
from bt_tasksim.planning.route import Pace, Route, followed
from bt_tasksim.planning.routes import SAMPLES, with_routes
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.planning.things import Leave
from bt_tasksim.planning.ways import WayFinder

NO_END = register_reason(
    "no_long_axis",
    "{object} has no ends: its longest side is {ratio} of the next one",
    ratio=SHARE,
)
NOT_OVER = register_reason(
    "not_tipped_over",
    "{object} leans by {value} from where it should be after it was tipped, more than {limit}",
    value=RADIANS,
    limit=RADIANS,
)
TIPPED = Form("{object} leans by {angle:.0f}, {felt:.1f} felt{touch}", {"angle": RADIANS, "felt": NEWTONS})

LONGER = 1.15
"""How many times as long as wide or high a thing has to be for its ends to be told."""
CLEAR = 0.0025
"""Metres above the surface at which the edge is kept: estimates are wrong by some."""
ROOMS = (CLOSER, VERY_CLOSE, TOUCHING)
"""How much closer than usual one may come to things, tried one after the other."""
AROUND = 16
"""Directions in which a round thing may be tipped."""
LEVEL = 0.003
"""Metres within which corners are as low as the lowest."""
NEAR_LEVEL = 0.03
"""Metres between a thing's lowest point and a surface up to which it stands or lies there."""
ASIDE = math.cos(math.radians(50.0))
"""Cosine of the angle to the side that was asked for within which a side counts as that."""
TRIED = 8
"""Sides over which it is tried to tip a thing."""
RAISED = 0.003
"""Metres above that to which it is brought where the arm cannot lead it over an edge."""
TURN = 0.7
"""Radians a second at which it is tipped."""
YIELDS, SOFTLY, STRONGEST = 1.0, 0.015, 5.0
"""N beyond those at the begin from which on what is tipped gives way upwards; metres a second for each N
above that: at a lever of a tenth of a metre a few newtons turn a thing between two fingers; and N that count
at most: an arm that gives way to all at once springs off the surface."""
DOWN, DEEPEST = 0.015, 0.010
"""Metres a second at which it is put down in the end, and how far at most below where it should stand."""
RIGHTS, RIGHTING, RIGHTED = 1.2, 3.0, math.radians(25.0)
"""Seconds at the end of the way in which what has turned in the hand is set right, as far as is seen; the
share of what it leans by which the hand turns it back in a second; and radians by which it does at most."""
LOW, HIGHEST = 0.03, 0.12
"""Metres of height that are made good in proportion, and by which the tool may be raised above its path."""
FELT = 2
"""Control periods in a row for which the surface must be felt."""
LEANS = math.radians(20.0)
"""Lean at the end with which it was not tipped over; what is held has turned in the hand by some of that."""


class TipMemory(NamedTuple):
    """What a tipping remembers in ``N`` worlds.

    Attributes:
        path: Tool path.
        baseline: Force ``(N,)`` upwards at the begin, or where it is put down at last, N.
        raised: Metres ``(N,)`` by which the tool is above its path.
        righted: Rotation vectors ``(N, 3)`` by which the tool is turned from its path, radians.
        middle: Where ``(N, 3)`` the object's middle is at the end of the path, metres.
        floor: Heights ``(N,)`` of its lowest point at the begin, metres.
        start: Metres ``(N,)`` by which the tool was raised when it began to come down.
        felt: Control periods ``(N,)`` in a row with the surface's force.
        down: Unit vectors ``(N, 3)`` in the object's frame that should point down in the end.
    """

    path: Path
    baseline: Array
    raised: Array
    righted: Array
    middle: Array
    floor: Array
    start: Array
    felt: Array
    down: Array


class Toppling(NamedTuple):
    """One way to tip a thing over.

    Attributes:
        down: Unit vector ``(3,)`` in its own frame that points down in the end.
        poses: Poses ``(n, 7)`` on the way, the present one left out.
    """

    down: Array
    poses: Array


class Tipping(ConceptModel[TipMemory]):
    """A task in which the held ``target`` is tipped over an edge that stays on what it lies on."""

    target: str
    towards: Any
    press: float
    speed: float
    force_limit: float

    maintains = (HOLDING,)
    default_timeout = 20.0
    words: ClassVar[str] = ""
    """What is done, as in "be tipped up"."""

    @classmethod
    def sides(cls, model: ObjectModel) -> list[Array]:
        """Unit vectors ``(3,)`` in an object's frame of which one points down in the end."""
        raise NotImplementedError

    def initial_state(self, seen: Seen) -> tuple[Possible, ...]:
        """The object must be in the hand, and have ends."""
        extent = seen.model(self.target).extent
        xp = array_namespace(extent)
        ordered = xp.sort(extent, axis=-1)
        ratio = ordered[:, 2] / ordered[:, 1]
        return not_held(seen, self.target), NO_END.where(ratio < LONGER, object=self.target, ratio=ratio)

    def begin(self, seen: Seen) -> TipMemory:
        """Find a side over which it can be tipped.

        Raises:
            NoWayError: There is none in one of the worlds.
        """
        found = [self._found(view) for view in views(seen)]
        path = plan([seen.tool], self.speed, samples=SAMPLES)  # there is a route in each world
        path = with_routes(
            path, {k: [route] for k, (route, _) in enumerate(found)}, len(seen.robot.arm_joints)
        )
        nothing = array_namespace(seen.tool).zeros_like(path.duration)
        down = constant(np.array([down for _, down in found]), seen.tool)
        middle = seen.object(self.target)[:, :3]
        return TipMemory(
            path, self._force(seen), nothing, 0.0 * down, middle, self._lowest(seen), nothing, nothing, down
        )

    def _found(self, view: WorldView) -> tuple[Route, Array]:
        grip = poses.relative(view.objects[self.target], view.tool)
        ways = spilling_none(view, self.target, self._swings(view))
        leave = Leave(held=frozenset(support_of(view, self.target)[0]))

        def finder_of(closer: float) -> WayFinder:
            return view.finder([self.target], held=view.held(self.target), leave=leave, closer=closer)

        def find(closer: float) -> tuple[Route, Array]:
            finder = finder_of(closer)
            for way in ways[:TRIED]:
                joints = followed_anyhow(finder, poses.multiply(way.poses, grip[None]))
                if joints is not None:
                    return followed(finder.arm, joints, Pace(self.speed, turn=TURN)), way.down
            raise NoWayError("the arm can follow none of its sides over their edges")

        def through_the_air(closer: float) -> tuple[Route, Array]:
            ends = self._ends(view, ways)
            tools = (poses.multiply(pose, grip) for _, pose in ends)
            found = brought(finder_of(closer), tools, Pace(self.speed))
            if found is None:
                raise NoWayError(
                    f"{self.target} cannot {self.words} as it is held: of {len(ways)} sides there is none on "
                    f"which the arm can set it with the room that there is; hold it otherwise, or make room"
                )
            route, chosen = found
            return route, ends[chosen][0]

        try:
            return with_room(ROOMS, find)
        except NoWayError:
            return with_room(ROOMS, through_the_air)

    def _ends(self, view: WorldView, ways: Sequence[Toppling]) -> list[tuple[Array, Array]]:
        """What points down in the end, and poses ``(7,)``: with any heading, the nearest first."""
        now, found = view.objects[self.target], []
        for way in ways:
            end = way.poses[-1] + np.array([*(now[:2] - way.poses[-1][:2]), RAISED, 0.0, 0.0, 0.0, 0.0])
            turned = (poses.quat_multiply(turn, end[3:]) for turn in headings(AROUND))
            found += [(way.down, np.concatenate([end[:3], turn])) for turn in turned]
        far = [float(poses.angle_between(pose[None, 3:], now[None, 3:])[0]) for _, pose in found]
        return [found[k] for k in np.argsort(np.round(far, 6), kind="stable").tolist()]

    def aim(self, view: WorldView) -> Aim | None:
        """From where it is on over one of its sides."""
        ways = self._swings(view)
        if not ways:
            return None
        count = max(len(way.poses) for way in ways)
        on = np.array([_spread(way.poses, max(2, count // 2)) for way in ways])
        now = np.array([lifted(view, self.target)] * len(ways))
        aside = np.array([pose for _, pose in self._ends(view, ways)])
        supports = frozenset(support_of(view, self.target)[0])
        return Aim(now, self.words, supports, True, aside=aside, onwards=on)

    def _swings(self, view: WorldView) -> list[Toppling]:
        """The sides over which it may be tipped, those first that were asked for, or need the least turn."""
        pose, model = lifted(view, self.target), view.model(self.target)
        every = [swing(pose, model, side) for side in self.sides(model)]
        found = [each for each in every if each is not None]
        if self.towards is None:
            return found
        asked = np.array(self.towards) * [1.0, 1.0, 0.0]
        asked = asked / max(float(np.linalg.norm(asked)), 1e-9)
        near = [float(_level(poses.rotate(pose[3:], each.down)) @ asked) for each in found]
        order = sorted(range(len(found)), key=lambda k: -round(near[k], 6))
        return [found[k] for k in order if near[k] >= ASIDE]

    def command(self, action: Array, seen: Seen, memory: TipMemory) -> Command:
        """Follow the path, raised or put down; the hand keeps its grip."""
        xp = array_namespace(seen.tool)
        tool, arm = at_times(memory.path, seen.elapsed)
        up = constant([0.0, 0.0, 1.0], tool)
        ended = (seen.elapsed >= memory.path.duration)[:, None]
        tool = xp.where(ended, turned_by(tool, memory.righted, memory.middle), tool)
        return Command(tool=poses.shifted(tool, memory.raised[:, None] * up), posture=arm)

    def advance(self, action: Array, seen: Seen, memory: TipMemory) -> TipMemory:
        """Give way on the way, and come down at its end until the surface is felt."""
        xp, period = array_namespace(seen.tool), seen.world.control_period
        force, late = self._force(seen), seen.elapsed - memory.path.duration
        ended = late >= RIGHTS
        ends_now = ended & (late < RIGHTS + period)
        leaning = poses.rotate(seen.object(self.target)[:, 3:], memory.down)
        still = constant([0.0, 0.0, -1.0], leaning) + xp.zeros_like(leaning)
        more = period * RIGHTING * poses.cross(leaning, still)
        now = (late >= 0.0) & ~ended & (poses.norm(memory.righted + more) < RIGHTED)
        righted = xp.where(now[:, None], memory.righted + more, memory.righted)
        middle = xp.where((late < period)[:, None], seen.object(self.target)[:, :3], memory.middle)
        low = poses.clip(memory.floor + CLEAR - self._lowest(seen), -LOW, LOW)
        baseline = xp.where(ends_now, xp.minimum(force, memory.baseline), memory.baseline)
        pressed = force - baseline
        yields = SOFTLY * poses.clip(pressed - YIELDS, 0.0, STRONGEST)
        felt = xp.where(ended & (pressed > self.press), memory.felt + 1.0, xp.zeros_like(memory.felt))
        falls = xp.where(ended & (felt == 0.0), xp.full_like(yields, -DOWN), xp.zeros_like(yields))
        rises = yields + poses.clip(low, 0.0, LOW)
        lifts = xp.where(late >= 0.0, RIGHTING * low, rises)
        lifts = xp.where(ended, falls, lifts)
        start = xp.where(ended, memory.start, memory.raised)
        raised = poses.clip(memory.raised + period * lifts, -HIGHEST, HIGHEST)
        raised = xp.where(ended, xp.maximum(raised, start - DEEPEST), raised)
        return memory._replace(
            baseline=baseline, raised=raised, righted=righted, middle=middle, start=start, felt=felt
        )

    def planned(self, memory: TipMemory) -> Array | float:
        """How long the way takes."""
        return searched_for(memory.path)

    def limits(self, seen: Seen, memory: TipMemory) -> tuple[Limit, ...]:
        """The force at the wrist; and in the end it should be tipped over."""
        over = Limit(
            NOT_OVER, self._leans(seen, memory), LEANS, {"object": self.target}, self._ended(seen, memory)
        )
        return strain(seen, self.force_limit), over

    def _ended(self, seen: Seen, memory: TipMemory) -> Array:
        deep = memory.raised <= memory.start - DEEPEST + 1e-9
        return (memory.felt >= FELT) | ((seen.elapsed >= memory.path.duration + RIGHTS) & deep)

    def done(self, seen: Seen, memory: TipMemory) -> Array:
        """It is tipped over, and the surface is felt, or it is as deep as it should go."""
        return self._ended(seen, memory) & (self._leans(seen, memory) <= LEANS)

    def maintained(self, goal: str, seen: Seen, memory: TipMemory) -> Array:
        """The object may still be in the hand."""
        return may_hold(seen, self.target)

    def necessary_cost(self, seen: Seen, memory: TipMemory) -> Array:
        """Angle from how it should be, radians."""
        return self._leans(seen, memory)

    def _leans(self, seen: Seen, memory: TipMemory) -> Array:
        """Angle ``(N,)`` between what should point down and straight down, radians."""
        return _angle_to_down(seen.object(self.target), memory.down)

    def sufficient_cost(self, known: Known, memory: TipMemory) -> Array:
        """How far it leans over what is tolerable; 1 at least unless it touches its support."""
        xp, now = array_namespace(known.hidden.tool_pose), known.object(self.target)
        leans = _angle_to_down(now, memory.down) / LEANS
        return xp.where(known.supported(self.target), leans, xp.maximum(leans, xp.ones_like(leans)))

    def explain(self, seen: Seen, memory: TipMemory) -> Statement:
        """How far it leans, and what is felt."""
        return TIPPED(
            object=self.target,
            angle=self._leans(seen, memory),
            felt=self._force(seen) - memory.baseline,
            touch=touched(seen, self.target),
        )

    def _lowest(self, seen: Seen) -> Array:
        """Height ``(N,)`` of the lowest point of the box about the object, as it is seen, metres."""
        now = seen.object(self.target)
        up = constant([0.0, 0.0, 1.0], now) + 0.0 * now[:, :3]
        return now[:, 2] - half_extent(now, seen.model(self.target), up)

    def _force(self, seen: Seen) -> Array:
        """Force ``(N,)`` upwards at the wrist, N."""
        return force_at_tool(seen)[:, 2]


def long_axis(model: ObjectModel) -> int | None:
    """The axis of an object's frame along which it is longest; None where that cannot be told."""
    order = np.argsort(model.extent)
    return None if model.extent[order[2]] < LONGER * model.extent[order[1]] else int(order[2])


def swing(pose: Array, model: ObjectModel, down: Array) -> Toppling | None:
    """How a thing at a pose ``(7,)`` is tipped until a direction ``(3,)`` in its frame points down.

    It turns about its lowest corners on that side. None where the direction points up or down already: there
    is no edge to that side.
    """
    way = poses.rotate(pose[3:], down)
    flat = _level(way)
    if float(np.linalg.norm(way[:2])) < 0.3:
        return None
    axis = np.array([-flat[1], flat[0], 0.0])
    corners = poses.transform(pose, np.concatenate(pieces_of(model)))
    low = corners[corners[:, 2] <= corners[:, 2].min() + LEVEL]
    far = float((low @ flat).max())
    edge = np.array([*(pose[:2] + (far - float(pose[:3] @ flat)) * flat[:2]), float(low[:, 2].min())])
    angle = math.pi / 2 + math.asin(min(1.0, max(-1.0, float(way[2]))))
    return Toppling(down, swung(pose, axis, edge, angle))


def support_of(view: WorldView, target: str) -> tuple[list[str], float]:
    """Names of what a thing may lie or stand on, and the height of its surface, metres."""
    corners = poses.transform(view.objects[target], np.concatenate(pieces_of(view.model(target))))
    low, middle = float(corners[:, 2].min()), corners.mean(axis=0)
    names, level = [], low
    nearest = NEAR_LEVEL
    for place in view.world.places.values():
        local = poses.localise(np.asarray(place.pose), middle)
        over = bool((np.abs(local[:2] - np.asarray(place.centre)) <= np.asarray(place.extent) / 2).all())
        gap = abs(float(place.pose[2]) - low)
        if over and place.fixture and gap < NEAR_LEVEL:
            names.append(place.fixture)
            if gap < nearest:
                nearest, level = gap, float(place.pose[2])
    return [*dict.fromkeys([*names, FURNITURE])], level


def lifted(view: WorldView, target: str) -> Array:
    """The pose ``(7,)`` of a thing with its lowest point a hair above what it lies or stands on."""
    pose = view.objects[target]
    low = float(poses.transform(pose, np.concatenate(pieces_of(view.model(target))))[:, 2].min())
    found: Array = pose + np.array([0.0, 0.0, support_of(view, target)[1] + CLEAR - low, 0.0, 0.0, 0.0, 0.0])
    return found


def around(axis: int) -> list[Array]:
    """Directions ``(3,)`` all around an axis of a frame."""
    others = [k for k in range(3) if k != axis]
    found = []
    for angle in 2 * math.pi * np.arange(AROUND) / AROUND:
        way = np.zeros(3)
        way[others[0]], way[others[1]] = math.cos(angle), math.sin(angle)
        found.append(way)
    return found


def _spread(some: Array, count: int) -> Array:
    """So many of some poses ``(n, 7)``, the last one among them."""
    found: Array = some[np.round(np.linspace(0, len(some) - 1, count + 1)[1:]).astype(int)]
    return found


def _level(way: Array) -> Array:
    """The level unit vector ``(3,)`` nearest to a direction ``(3,)``."""
    flat = np.array([way[0], way[1], 0.0])
    found: Array = flat / max(float(np.linalg.norm(flat)), 1e-9)
    return found


def _angle_to_down(pose: Array, down: Array) -> Array:
    """Angles ``(N,)`` between directions ``(N, 3)`` of things and straight down, radians."""
    height = poses.rotate(pose[:, 3:], down)[:, 2]
    return array_namespace(height).acos(poses.clip(-height, -1.0, 1.0))
