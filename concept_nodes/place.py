"""Place: put a held object down until it is felt to stand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.demonstrated import position_words, straight_words
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import (
    Direction,
    Flag,
    Metres,
    MetresPerSecond,
    Newtons,
    ObjectName,
    PlaceName,
)
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes.closer import DROPPED, HIGHER, PUT_DOWN, TOUCHING, with_room
from bt_tasksim.concept_nodes.destination import destination, standing_pose
from bt_tasksim.concept_nodes.drops import preferred_options
from bt_tasksim.concept_nodes.holding import HOLDING, may_hold, not_held
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, force_at_tool, gentler, strain
from bt_tasksim.concept_nodes.spots import spots_beside, spots_on, supports_beside
from bt_tasksim.concept_nodes.standing import aside_options, supports_of, tipped
from bt_tasksim.concept_nodes.surface import (
    NEAR,
    apart,
    carrying,
    edges,
    level_of,
    straight_down,
)
from bt_tasksim.concept_nodes.touching import touched
from bt_tasksim.concept_nodes.view import WorldView, host_numbers, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, NoWayError
from bt_tasksim.core.outcomes import Form, Possible, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register
from bt_tasksim.core.transfer import fetched
from bt_tasksim.core.units import METRES, NEWTONS, RADIANS
from bt_tasksim.core.world import Command
from bt_tasksim.planning.arm import FULL, LEANS, SET_DOWN
from bt_tasksim.planning.reference_motion import Path, at_times, plan, position, searched_for
from bt_tasksim.planning.route import Pace, Route, followed
from bt_tasksim.planning.routes import SAMPLES, with_routes
from bt_tasksim.planning.things import Leave
from bt_tasksim.scene.spatial_laws import beyond_edges

NOT_ABOVE = register_reason("not_above", "{object} is {aside} beyond the edge of {place}", aside=METRES)
NOTHING_BELOW = register_reason("nothing_below", "nothing that carries is known below {object}")
NOT_BESIDE = register_reason(
    "not_beside", "{object} is {gap} from {other}, more than {limit}", gap=METRES, limit=METRES
)
FELT_AND_MISSED = Form(
    "{felt:.1f} felt, {object} {distance} from its spot{touch}", {"felt": NEWTONS, "distance": METRES}
)
LEANS_ON = register_reason(
    "leans",
    "{object} leans by {value} on what it was put down on, more than {limit}",
    value=RADIANS,
    limit=RADIANS,
)
NOT_THERE = register_reason(
    "not_there",
    "{object} is {value:.3g} from where it should stand, more than {limit:.3g}",
    value=METRES,
    limit=METRES,
)
MISSED, LATE = 0.03, 1.0
"""Metres from where it should stand at which an object was not put down there; and seconds after the way's
end until which it may still come there."""
AROUND = 0.2
"""Peak speed of the tool where it cannot come straight down, m/s."""
LEANING = math.radians(10.0)
"""Lean against its support with which an object does not stand on it: it lies on something else, too. An arm
of few joints may lean it by `SET_DOWN` more, and it stands up when it is let go."""
ACCELERATION = 0.5
"""Peak acceleration of the tool on its way down, m/s^2."""
EARLY, UNEXPECTED = 0.03, 5
"""Metres above where the object should stand from which on its support has to be felt for so many times as
long: a hand that has just come to rest shakes, and so does what it holds."""
ROOMS = ((PUT_DOWN, 0.0), (TOUCHING, 0.0), (TOUCHING, DROPPED))
"""What is tried one after the other: how much closer than usual one may come to things, and metres above its
support where the way may end."""
FROM_HIGHER = tuple((TOUCHING, above) for above in HIGHER)
"""The same after that."""
OTHERS = 8
"""Rotations in which an object may stand, too, that are tried where it cannot come down as it is held."""
SLOWLY, GENTLY = 0.02, 0.4
"""Metres above where the object should stand below which it goes slower, and the least share of the path's
speed: what meets its support at 80 mm/s in the hand of a stiff arm strains the wrist with 60 to 80 N."""
SLOWEST = 0.003
"""Metres per second that it goes at least: where the way itself is slow, as where the tool turns more than it
comes down, a small share of its speed would not arrive in time."""
UNSURE = 0.005
"""Metres by which something may stand higher than it is seen to: twice the error of a good estimate. An arm
near its base, which is stiff, goes as slowly as it can from there on."""
FELT = 2
"""Ticks in a row for which the support must be felt."""


HARD = 5.0
"""Times `press` from which a force counts as felt for `FELT` ticks at once: what hits its support bounces,
and is felt no more a tick later."""


class PlaceMemory(NamedTuple):
    """What a place remembers in ``N`` worlds.

    Attributes:
        path: Tool path to the deepest pose that is tried.
        baseline: Force ``(N,)`` against the direction of placing when it began, N.
        felt: Ticks ``(N,)`` in a row with the support's force.
        progress: Seconds ``(N,)`` of the path that have been commanded.
        around: Booleans ``(N,)``: the path does not lead straight there.
    """

    path: Path
    baseline: Array
    felt: Array
    progress: Array
    around: Array


@register("concept")
class Place(ConceptModel[PlaceMemory]):
    """Put a held object down on a place or on another object (makes contact: NC to PC).

    The object goes over the place's origin and down along ``direction``, slowly, and stops when the wrist
    feels the support, or ``overshoot`` below where the support should be. With ``anywhere`` or ``beside`` it
    goes straight down from where it is; ``anywhere`` alone means the place that is below it then. Where there
    is something else right below, it goes ``anywhere`` to a free spot of the place.

    Args:
        target: The held object.
        on: The place, or the object to put it on.
        anywhere: Anywhere on the place will do; without one, on whichever is below.
        beside: The object next to which it is put, on what that stands on; instead of ``on``.
        direction: Direction in which it is put down, robot base frame.
        distance: How far it is put down at most; by default to where the support should be.
        overshoot: How much deeper is tried.
        press: Force that counts as support.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    on: PlaceName | None = None
    anywhere: Flag = False
    beside: ObjectName | None = None
    direction: Direction = (0.0, 0.0, -1.0)
    distance: Metres | None = None
    overshoot: Metres = 0.006
    press: Newtons = 3.0
    speed: MetresPerSecond = 0.08
    force_limit: Newtons = FORCE_LIMIT

    maintains = (HOLDING,)
    establishes = (
        ConditionOf("AtPose", target="target", on="on", given={"anywhere": False}),
        ConditionOf("StandsOn", target="target", place="on", given={"anywhere": True}),
        ConditionOf("Beside", target="target", other="beside"),
    )
    requires = (
        ConditionOf("Over", target="target", place="on", anywhere="anywhere"),
        ConditionOf("OverBeside", target="target", other="beside"),
        ConditionOf("Clear", place="on", target="target", anywhere="anywhere"),
    )
    contact = ContactChange(ContactState.NC, ContactState.PC)
    presentation = Presentation(
        colour="#8a56a8",
        spoken=r"plac|put|set(?:ting)? .* down|stand .* on|\blay",
        sayings=("put it down on the {}", "I place it on the {}", "set it down gently"),
        says_destination=True,
    )
    default_timeout = 10.0

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Onto what, and how far which way."""
        said = [f"onto {parameters['on']}"] if "on" in parameters else []
        said += [f"beside {parameters['beside']}"] if "beside" in parameters else []
        if "position" in parameters:
            said.append(f"to {position_words(parameters['position'])}")
        return ", ".join([*said, *([straight_words(parameters)] if "distance" in parameters else [])])

    @classmethod
    def from_task(cls, task: Task, later: Sequence[Task]) -> dict[str, Any]:
        """What it is put on; how far it goes is felt.

        Raises:
            InputError: The log does not name what it was put on.
        """
        given = task.parameters
        if not given.get("on"):
            raise InputError(
                f"'{given['target']}' was placed on something that the log does not name: "
                f"name the surface in the log's 'places'"
            )
        return {"target": given["target"], "on": given["on"]}

    def contradiction(self) -> str:
        """One place, neither none nor two."""
        if self.anywhere:
            return "" if self.beside is None else "'anywhere' goes with 'on', a place, or stands alone"
        return "give either 'on' or 'beside'" if (self.on is None) == (self.beside is None) else ""

    def initial_state(self, seen: Seen) -> tuple[Possible, ...]:
        """The object must be in the hand, and above where it is to be put."""
        held = not_held(seen, self.target)
        now = seen.object(self.target)
        if self.beside is not None:
            gap, _ = apart(seen, self.target, self.beside)
            far = NOT_BESIDE.where(gap > NEAR, object=self.target, other=self.beside, gap=gap, limit=NEAR)
            return held, far
        if self.on is None:
            return held, NOTHING_BELOW.where(~carrying(seen, self.target).found, object=self.target)
        if not self.anywhere:
            return (held,)
        aside = beyond_edges(destination(seen, self.on)[0], *edges(seen, self.on), now)
        return held, NOT_ABOVE.where(aside > 0.0, object=self.target, place=self.on, aside=aside)

    def begin(self, seen: Seen) -> PlaceMemory:
        """A path down to the place's origin, or to what is right below.

        Raises:
            NoWayError: It is not clear in one of the worlds.
        """
        xp, now = array_namespace(seen.tool), seen.object(self.target)
        d = poses.constant(self.direction, now)
        goal = poses.shifted(self._standing(seen), self.overshoot * d)
        if self.distance is not None:
            along = poses.dot(goal[:, :3] - now[:, :3], d)
            beyond = xp.minimum(self.distance + self.overshoot - along, xp.zeros_like(along))
            goal = poses.shifted(goal, beyond[:, None] * d)
        tool_goal = poses.multiply(goal, poses.relative(now, seen.tool))
        (goals,) = host_numbers([tool_goal])
        found = [
            place._found(view, goals[k])
            for k, (place, view) in enumerate(zip(self._by_world(seen), views(seen), strict=True))
        ]
        routes = {k: [route] for k, (_, route, _) in enumerate(found)}
        tool_goal = poses.constant(np.array([goal for goal, _, _ in found]), now)
        around = xp.asarray([around for _, _, around in found], device=now.device)
        path = plan([seen.tool], self.speed, samples=SAMPLES)  # there is a route in each world
        path = with_routes(path, routes, len(seen.robot.arm_joints))
        nothing = xp.zeros_like(path.duration)
        felt = xp.astype(nothing, xp.int64)
        return PlaceMemory(path, self._force(seen), felt, nothing - seen.world.control_period, around)

    def _by_world(self, seen: Seen) -> list[Place]:
        """The same in each world, with the place that is below named."""
        if self.on is not None or self.beside is not None:
            return [self] * seen.tool.shape[0]
        (ranks,) = fetched([carrying(seen, self.target).place.rank])
        below = (list(seen.world.model_of(k).places)[int(rank)] for k, rank in enumerate(ranks))
        return [type(self).value(**{**self.arguments(), "on": name}) for name in below]

    def _standing(self, seen: Seen) -> Array:
        """Poses ``(N, 7)`` of the object where it should stand."""
        key = ("standing", self.target, self.on, self.beside, self.anywhere)
        return seen.once(key, lambda: self._stands(seen), by_world=True)

    def _stands(self, seen: Seen) -> Array:
        now, model = seen.object(self.target), seen.model(self.target)
        if self.beside is not None:
            return straight_down(level_of(seen, self.beside), now, model)
        if self.on is None:
            return straight_down(carrying(seen, self.target).place.pose, now, model)
        frame, _ = destination(seen, self.on)
        if self.anywhere:
            return straight_down(frame, now, model, edges(seen, self.on))
        return standing_pose(frame, now, model)

    def _found(self, view: WorldView, goal: Array) -> tuple[Array, Route, bool]:
        """The tool pose ``(7,)`` to go to, the way, and whether it leads around something.

        The object is turned by its symmetry, or tipped, where need be.

        A way around is the last resort: to come down a little aside, or turned, or to let go a little higher,
        is much shorter, and nothing is scraped on the way.

        Raises:
            NoWayError: There is none; says what would touch what as it is held now.
        """
        others: Array | None = None
        for rooms, around in ((ROOMS, False), (FROM_HIGHER, False), (ROOMS, True)):
            try:
                return goal, self._down(view, goal, rooms, around), around
            except NoWayError as error:
                reason = error  # the last one says what would touch what
            others = self._other_ends(view) if others is None else others
            for other in others:
                with suppress(NoWayError):
                    return other, self._down(view, other, rooms, around), around
        raise reason

    def _other_ends(self, view: WorldView) -> Array:
        """Tool poses ``(k, 7)`` in which the object would stand there, too, the least turned first.

        After them those a little aside of there, and last those in which it leans there; an arm of few joints
        leans it by itself. Where anywhere will do, those on free spots, the nearest first; in a container
        there are none.
        """
        if self.on is None or self.distance is not None:
            return np.zeros((0, 7))
        place = view.world.places.get(self.on)
        if (place is None and self.on not in view.objects) or (place is not None and place.container):
            return np.zeros((0, 7))
        now = view.objects[self.target]
        grip = poses.relative(now, view.tool)
        if self.anywhere:
            spots = spots_on(view, self.target, self.on).poses
            nearest = np.argsort(np.linalg.norm(spots[:, :2] - now[:2], axis=-1), kind="stable")
            return poses.multiply(spots[nearest[:OTHERS]], grip[None]) + self.overshoot * self._along
        options = preferred_options(view, self.target, self.on)
        leaning = tipped(options[:1], grip) if len(view.arm) >= FULL else options[:0]
        aside = aside_options(view, self.on, options[:1], held=True)
        nearest = np.argsort(np.linalg.norm(aside[:, :2] - now[:2], axis=-1), kind="stable")
        tried = np.concatenate([options[1 : 1 + OTHERS], aside[nearest], leaning])
        return poses.multiply(tried, grip[None]) + self.overshoot * self._along

    def _down(
        self, view: WorldView, goal: Array, rooms: Sequence[tuple[float, float]], around: bool
    ) -> Route:
        """The way down to a tool pose ``(7,)``: straight, or ``around`` what is in the way.

        Args:
            view: The world.
            goal: The pose.
            rooms: What is tried, see `ROOMS`.
            around: It need not be straight.

        Raises:
            NoWayError: There is none; says what would touch what.
        """

        def find(room: tuple[float, float, float]) -> Route:
            closer, above, leans = room
            end = goal - (self.overshoot + above) * self._along
            return self._down_to(view, end, closer, None if above else goal, leans, around)

        slanted = rooms if len(view.arm) < FULL else ()
        return with_room(
            [*((*room, LEANS) for room in rooms), *((*room, SET_DOWN) for room in slanted)], find
        )

    def _down_to(
        self,
        view: WorldView,
        standing: Array,
        closer: float,
        deeper: Array | None,
        leans: float,
        around: bool,
    ) -> Route:
        """The way to a tool pose ``(7,)`` in which the object stands, and on to a deeper one, if any.

        Args:
            view: The world.
            standing: The pose.
            closer: How much closer than usual one may come to things.
            deeper: A deeper one ``(7,)``.
            leans: Radians by which an arm of few joints may turn its tool from them.
            around: It need not be straight.
        """
        leave = Leave(held=self._supports(view))
        finder = view.finder([self.target], held=view.held(self.target), leave=leave, closer=closer)
        pace = Pace(self.speed, acceleration=ACCELERATION)
        if not around:
            straight = finder.straight([view.tool, standing], spacing=0.02, leans=leans)
            if straight is None:
                raise NoWayError(f"no way straight down {self._where}")
            way = np.concatenate([finder.start[None], straight])
        else:
            pace = Pace(AROUND)
            try:
                way = finder.search(standing[None], pace, leans=leans).joints
            except NoWayError:
                touches = finder.touched(standing)
                why = f"{touches[0][0]} would touch {touches[0][1]}" if touches else "the arm cannot follow"
                raise NoWayError(f"no way straight down {self._where}: {why}") from None
        end = None if deeper is None else finder.arm.along(way[-1], deeper[None], leans)
        return followed(finder.arm, way if end is None else np.concatenate([way, end]), pace)

    @property
    def _along(self) -> Array:
        return np.array([*self.direction, 0.0, 0.0, 0.0, 0.0])

    @property
    def _where(self) -> str:
        return f"onto {self.on}" if self.on is not None else f"beside {self.beside}"

    def _supports(self, view: WorldView) -> frozenset[str]:
        """Names of what the object touches when it stands."""
        if self.on is not None:
            return supports_of(view, self.on)
        assert self.beside is not None
        return supports_beside(view, self.target, self.beside)

    def aim(self, view: WorldView) -> Aim | None:
        """Where it is put down; None where only what is below it then says so."""
        if self.on is None and self.beside is None:
            return None
        if self.on is not None and not self.anywhere:
            options = preferred_options(view, self.target, self.on)
            aside = aside_options(view, self.on, options)
            return Aim(options, f"be put down on {self.on}", supports_of(view, self.on), aside=aside)
        if self.on is not None:
            spots = spots_on(view, self.target, self.on)
        else:
            assert self.beside is not None
            spots = spots_beside(view, self.target, self.beside)
        return Aim(spots.poses[spots.few], f"be put down {self._where}", spots.supports)

    def command(self, action: Array, seen: Seen, memory: PlaceMemory) -> Command:
        """Follow the path, and stop on it as long as the support is felt; the hand keeps its grip."""
        return self._commanded(memory, self._progress(seen, memory))

    def advance(self, action: Array, seen: Seen, memory: PlaceMemory) -> PlaceMemory:
        """Count the ticks at which the support is felt."""
        return self._after(seen, memory, self._progress(seen, memory))

    def carry_out(self, action: Array, seen: Seen, memory: PlaceMemory) -> tuple[Command, PlaceMemory]:
        """Both, of the same progress."""
        progress = self._progress(seen, memory)
        return self._commanded(memory, progress), self._after(seen, memory, progress)

    def _commanded(self, memory: PlaceMemory, progress: Array) -> Command:
        tool, arm = at_times(memory.path, progress)
        return Command(tool=tool, posture=arm)

    def _after(self, seen: Seen, memory: PlaceMemory, progress: Array) -> PlaceMemory:
        xp = array_namespace(seen.tool)
        hard = self._force(seen) - memory.baseline > HARD * self.press
        more = xp.where(hard, xp.full_like(memory.felt, FELT), xp.ones_like(memory.felt))
        felt = xp.where(self._supported(seen, memory), memory.felt + more, xp.zeros_like(memory.felt))
        return memory._replace(felt=felt, progress=progress)

    def planned(self, memory: PlaceMemory) -> Array | float:
        """How long the way takes, where it was searched for."""
        return searched_for(memory.path)

    def limits(self, seen: Seen, memory: PlaceMemory) -> tuple[Limit, ...]:
        """The force at the wrist; and in the end the object should be there, unless a distance was given."""
        if self.distance is not None:
            return (strain(seen, self.force_limit),)
        now, standing = seen.object(self.target), self._standing(seen)
        missed, leans = poses.norm(now[:, :3] - standing[:, :3]), poses.tilt(now[:, 3:], standing[:, 3:])
        names = {"object": self.target}
        most = LEANING + (SET_DOWN if len(seen.robot.arm_joints) < FULL else 0.0)
        ended = (memory.felt >= self._surely(seen)) | (memory.progress >= memory.path.duration + LATE)
        return (
            strain(seen, self.force_limit),
            Limit(NOT_THERE, missed, MISSED, names, counts=ended),
            Limit(LEANS_ON, leans, most, names, counts=ended & ~seen.model(self.target).ball),
        )

    def done(self, seen: Seen, memory: PlaceMemory) -> Array:
        """The support is felt, or the object is where it should stand, or as far down as it should go."""
        ended = memory.progress >= memory.path.duration + 0.2
        if self.distance is None:
            ended = ended & (self.necessary_cost(seen, memory) <= MISSED)
        return (memory.felt >= self._surely(seen)) | ended

    def maintained(self, goal: str, seen: Seen, memory: PlaceMemory) -> Array:
        """The object may still be in the hand."""
        return may_hold(seen, self.target)

    def necessary_cost(self, seen: Seen, memory: PlaceMemory) -> Array:
        """Distance of the object from where it should stand, metres."""
        return poses.norm(seen.object(self.target)[:, :3] - self._standing(seen)[:, :3])

    def sufficient_cost(self, known: Known, memory: PlaceMemory) -> Array:
        """1 unless the object touches its support."""
        xp, cost = array_namespace(known.hidden.tool_pose), known.hidden.tool_pose[:, 0]
        return xp.where(known.supported(self.target), xp.zeros_like(cost), xp.ones_like(cost))

    def explain(self, seen: Seen, memory: PlaceMemory) -> Statement:
        """What is felt, and how far the object is from where it should stand."""
        return FELT_AND_MISSED(
            felt=self._force(seen) - memory.baseline,
            object=self.target,
            distance=self.necessary_cost(seen, memory),
            touch=touched(seen, self.target),
        )

    def _force(self, seen: Seen) -> Array:
        """Force ``(N,)`` in N against the direction of placing."""

        def against() -> Array:
            force = force_at_tool(seen)
            return -poses.dot(force, poses.constant(self.direction, force))

        return seen.once(("force", *self.direction), against, by_world=True)

    def _progress(self, seen: Seen, memory: PlaceMemory) -> Array:
        xp = array_namespace(seen.tool)
        share = gentler(seen.tool)
        gently, unsure = GENTLY * share, UNSURE * (1.0 - share)
        pace = xp.minimum(xp.maximum((self._above(seen) - unsure) / SLOWLY, gently), xp.ones_like(gently))
        period = seen.world.control_period
        here, ahead = (position(memory.path, memory.progress + later) for later in (0.0, period))
        least = SLOWEST * period / poses.clip(poses.norm(ahead - here), SLOWEST * period, math.inf)
        pace = xp.maximum(pace, least)
        pace = xp.where(memory.progress >= memory.path.duration, xp.ones_like(pace), pace)
        on = memory.progress + period * pace
        return xp.where(self._supported(seen, memory), memory.progress, on)

    def _supported(self, seen: Seen, memory: PlaceMemory) -> Array:
        """The support is felt; not on a way around, where forces change as the arm turns, and it is aside."""
        felt = (self._force(seen) - memory.baseline > self.press) & (seen.elapsed > 0.25)
        return felt & ~(memory.around & (self._aside(seen) > MISSED))

    def _aside(self, seen: Seen) -> Array:
        """How far ``(N,)`` the object is beside where it should stand, metres."""
        off = self._standing(seen)[:, :3] - seen.object(self.target)[:, :3]
        d = poses.constant(self.direction, seen.tool)
        return poses.norm(off - poses.dot(off, d)[:, None] * d)

    def _above(self, seen: Seen) -> Array:
        """How far ``(N,)`` the object is above where it should stand, metres."""
        now, d = seen.object(self.target), poses.constant(self.direction, seen.tool)
        return poses.dot(self._standing(seen)[:, :3] - now[:, :3], d)

    def _surely(self, seen: Seen) -> Array:
        """Ticks ``(N,)`` in a row for which the support must be felt here."""
        above = self._above(seen)
        xp = array_namespace(above)
        usual = xp.full(above.shape, FELT, dtype=xp.int64, device=above.device)
        return xp.where(above > EARLY, usual * UNEXPECTED, usual)
