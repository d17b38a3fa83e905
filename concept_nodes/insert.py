"""Insert: push a held peg or book into a hole, down to its stop, and search for the mouth where it jams."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import (
    Direction,
    MetresPerSecond,
    Newtons,
    ObjectName,
    PlaceName,
    Ratio,
)
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes.holding import HOLDING, may_hold, not_held
from bt_tasksim.concept_nodes.insertion import places_to_try
from bt_tasksim.concept_nodes.insertion_edges import Edges, away, edges_of, held_up_at, wrench_of
from bt_tasksim.concept_nodes.insertion_way import (
    STANDOFF,
    WayIn,
    ends_in,
    joints_line,
    sides_of,
    way_in,
    yielding,
)
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, force_at_tool, force_at_wrist, strain
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.outcomes import Form, Possible, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import COUNT, METRES, NEWTONS
from bt_tasksim.core.world import FURNITURE, Command
from bt_tasksim.planning.reference_motion import Path, at_times, plan, searched_for
from bt_tasksim.planning.routes import SAMPLES, with_routes

PUSHED = Form(
    "{object} is {depth} deep in {place}, {missing} from where it should end, {force} at the wrist, "
    "{count:.0f} places tried",
    {"depth": METRES, "missing": METRES, "force": NEWTONS, "count": COUNT},
)
JAMMED = register_reason(
    "jammed",
    "{object} does not go into {place}: {value:.0f} places were tried, and there are no more",
    value=COUNT,
    limit=COUNT,
)
SETTLE = 0.4
"""Seconds for which it rests there before what the wrist feels is taken for its weight."""
LINED, LINING, GAIN = (0.001, math.radians(0.5)), 3.0, 0.12
"""Metres and radians within which it is lined up with the hole, seconds after which it goes in anyhow, and
the share of what is missing by which it is lined up in a control period."""
NEAR = 0.006
"""Metres from where it should end at which a push that is felt is that of the stop."""
SLIPS = 0.03
"""Metres that it may slip back in the hand as it is pushed in."""
FEELS = 12.0
"""Places to which it goes by what the wrist feels, before others are tried about the last of them."""
FAR, TURNED = 0.006, math.radians(4.0)
"""Metres aside, and radians about the way in, as far as it goes by that."""
STUCK, LITTLE = 0.35, 0.0005
"""Seconds in which it has come on by less than so many metres where it jams."""
BACK, QUICKLY = 0.003, 0.06
"""Metres that it draws back before it tries another place, and metres a second."""
GENTLY, SLOWLY, LIGHTLY = 0.008, 0.4, 0.5
"""Metres before the mouth, or before where it has jammed, from which on it comes more slowly until it is
beyond that, at what share of the usual speed, and with what share of the usual force: an arm that meets an
edge at 40 mm/s strains itself."""
ASIDE = 0.02
"""Metres a second at which it goes from one place to the next."""


class InsertMemory(NamedTuple):
    """What an insertion remembers in ``N`` worlds.

    Attributes:
        path: Tool path to before the mouth.
        line: The arm's joints from there straight in, evenly along the way.
        start: Poses ``(N, 7)`` of the object before the mouth.
        inward: Unit vectors ``(N, 3)`` into the hole.
        sides: Unit vectors ``(N, 2, 3)`` across it; along the first one it is less known where the object is.
        mouth: Metres ``(N,)`` from there at which the object's end is at the mouth.
        full: Metres ``(N,)`` from there to where it should end.
        lies: How it lies in the hand ``(N, 7)``, as seen from where it seems to be.
        grip: The tool's pose ``(N, 7)`` in the object.
        weight: Force and torque ``(N, 6)`` at the tool at rest before the mouth, robot base frame.
        edges: The hole in which it goes, see `Edges`.
        begun: Booleans ``(N,)``: it goes in.
        lines: Booleans ``(N,)``: it has come before the mouth, and is lined up with it.
        way: Metres ``(N,)`` from `start` that it is told to be.
        offset: Metres ``(N, 3)`` aside of there.
        centre: Metres ``(N, 3)`` aside of there, about which places are tried.
        turn: Radians ``(N,)`` about the way in by which it is turned.
        felt: How hard, and where, it was held up since it jammed last, see `held_up_at`.
        back: Metres ``(N,)`` from `start` to which it draws back; infinite where it comes on.
        jammed: Metres ``(N,)`` from `start` at which it jammed, where it was deepest; 0 where it has not.
        tried: How many places about the mouth were tried ``(N,)``.
        best: Metres ``(N,)`` that it was seen to have come.
        stuck: Seconds ``(N,)`` since it came on.
    """

    path: Path
    line: Path
    start: Array
    inward: Array
    sides: Array
    mouth: Array
    full: Array
    lies: Array
    grip: Array
    weight: Array
    edges: Edges
    begun: Array
    lines: Array
    way: Array
    offset: Array
    centre: Array
    turn: Array
    felt: Array
    back: Array
    jammed: Array
    tried: Array
    best: Array
    stuck: Array


@register("concept")
class Insert(ConceptModel[InsertMemory]):
    """Push a held object into a hole (makes contact: NC to OP).

    The object is brought before the mouth, turned as it fits, the least way round, and goes straight in, the
    slower the more the wrist feels. Where it jams it draws back a little and goes away from the edge that the
    wrist has felt, and then tries other places about the mouth. It ends at the hole's stop, or as deep as is
    asked.

    Args:
        target: The held object.
        into: The hole: a place of this kind.
        leading: Axis of the object that goes in first, in its frame; by default whichever end is nearest.
        share: How deep it goes, of the hole's depth.
        press: Force with which it is pushed at most.
        speed: Peak speed of the tool to before the mouth.
        feed: Speed at which it goes in where nothing resists.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    into: PlaceName
    leading: Direction | None = None
    share: Ratio = 1.0
    press: Newtons = 15.0
    speed: MetresPerSecond = 0.3
    feed: MetresPerSecond = 0.04
    force_limit: Newtons = FORCE_LIMIT

    maintains = (HOLDING,)
    establishes = (ConditionOf("Inserted", target="target", hole="into"),)
    requires = (ConditionOf("Lifted", target="target"),)
    contact = ContactChange(ContactState.NC, ContactState.OP)
    presentation = Presentation(
        colour="#3d7ea6",
        spoken=r"insert|push .* in(?:to)?\b|plug|stick .* in(?:to)?\b",
        sayings=("I push it into the {}", "insert it into the {}", "it goes into the {}"),
        says_destination=True,
    )
    default_timeout = 90.0
    default_tolerance = 0.003

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Into what."""
        return f"into {parameters['into']}" if "into" in parameters else ""

    @classmethod
    def from_task(cls, task: Task, later: Sequence[Task]) -> dict[str, Any]:
        """What goes into what."""
        return {"target": task.parameters["target"], "into": task.parameters["into"]}

    def initial_state(self, seen: Seen) -> Possible:
        """The object must be in the hand."""
        return not_held(seen, self.target)

    def begin(self, seen: Seen) -> InsertMemory:
        """The way to before the mouth, and straight in.

        Raises:
            NoWayError: In one of the worlds it does not fit, or there is no way.
        """
        found = [self._found(view) for view in views(seen)]
        like, worlds, n_arm = seen.tool, len(found), len(seen.robot.arm_joints)
        path = plan([seen.tool], self.speed, samples=SAMPLES)
        path = with_routes(path, {k: [way.route] for k, way in enumerate(found)}, n_arm)
        start = constant(np.array([way.start for way in found]), like)
        end = constant(np.array([way.end for way in found]), like)
        full = poses.norm(end[:, :3] - start[:, :3])
        xp = array_namespace(like)
        nothing = xp.zeros_like(full)
        inward = (end[:, :3] - start[:, :3]) / full[:, None]
        lies = constant(np.array([way.lies for way in found]), like)
        held = poses.multiply(seen.object(self.target), lies)
        joints = constant(np.array([way.joints for way in found]), like)
        return InsertMemory(
            path=path,
            line=joints_line(joints, start),
            start=start,
            inward=inward,
            sides=sides_of(path.table[:, -1, 3:], inward),
            mouth=nothing + STANDOFF,
            full=full,
            lies=lies,
            grip=poses.relative(held, seen.tool),
            weight=xp.concat([xp.zeros_like(inward)] * 2, axis=-1),
            edges=edges_of(seen, self.target, self.into, end),
            begun=nothing > 1.0,
            lines=nothing > 1.0,
            way=nothing,
            offset=xp.zeros_like(inward),
            centre=xp.zeros_like(inward),
            turn=nothing,
            felt=xp.zeros((worlds, 4), dtype=like.dtype, device=like.device) + 0.0 * full[:, None],
            back=nothing + math.inf,
            jammed=nothing,
            tried=nothing,
            best=nothing,
            stuck=nothing,
        )

    def _found(self, view: WorldView) -> WayIn:
        leading = None if self.leading is None else np.array(self.leading)
        return way_in(view, self.target, self.into, leading, self.share, self.speed)

    def aim(self, view: WorldView) -> Aim | None:
        """In the hole: the hand has to have room there, too."""
        hole = view.world.places[self.into]
        leading = None if self.leading is None else np.array(self.leading)
        try:
            ends = ends_in(view, self.target, self.into, leading, self.share)
        except NoWayError:
            return None  # it is said when it begins
        return Aim(ends, f"be pushed into {self.into}", frozenset([hole.fixture or FURNITURE]))

    def command(self, action: Array, seen: Seen, memory: InsertMemory) -> Command:
        """Along the path, and then straight in, aside of there as the search says."""
        xp = array_namespace(seen.tool)
        tool, arm = at_times(memory.path, seen.elapsed)
        _, joints = at_times(memory.line, poses.clip(memory.way / memory.full, 0.0, 1.0))
        assert joints is not None
        inside = poses.multiply(self._told(memory), memory.grip)
        begun = memory.lines[:, None]
        arm = joints if arm is None else arm
        return Command(tool=xp.where(begun, inside, tool), posture=xp.where(begun, joints, arm))

    def advance(self, action: Array, seen: Seen, memory: InsertMemory) -> InsertMemory:
        """Line up and weigh before the mouth; then come on as the wrist allows, and search where it jams."""
        xp, period = array_namespace(seen.tool), seen.world.control_period
        wrench = wrench_of(seen)
        force = wrench[:, :3]
        now = self._now(seen, memory)
        come = poses.dot(now[:, :3] - memory.start[:, :3], memory.inward)
        rested = seen.elapsed - memory.path.duration - SETTLE
        off = poses.norm(now[:, :3] - memory.start[:, :3])
        turned = poses.angle_between(now[:, 3:], memory.start[:, 3:])
        lined = (off < LINED[0]) & (turned < LINED[1]) | (rested > LINING)
        begins = (rested >= 0.0) & lined & ~memory.begun
        weights = xp.where(begins[:, None], wrench, memory.weight)
        weight = weights[:, :3]
        feeds = memory.begun & ~xp.isfinite(memory.back)
        on = come > memory.best + LITTLE
        stuck = xp.where(on | ~feeds, xp.zeros_like(come), memory.stuck + period)
        jams = feeds & (stuck > STUCK) & (come < memory.full - NEAR)
        tried = xp.where(jams, memory.tried + 1.0, memory.tried)
        felt = memory.felt + held_up_at(seen.tool, now, wrench - weights, memory.inward, memory.edges)
        felt = xp.where(feeds[:, None], felt, memory.felt)
        aside, turn = away(felt, memory.inward, memory.edges)
        feels = jams & (tried <= FEELS)
        centre = xp.where(feels[:, None], memory.centre + aside, memory.centre)
        turn = xp.where(feels, memory.turn + turn, memory.turn)
        back = xp.where(jams, xp.maximum(come - BACK, 0.0 * come), memory.back)
        memory = memory._replace(centre=poses.clip(centre, -FAR, FAR), turn=poses.clip(turn, -TURNED, TURNED))
        places = places_to_try(seen.robot)
        spiral = poses.clip(tried - FEELS, 0.0, math.inf)
        offset, there = self._aside(force - weight, come, spiral, memory, period, places)
        # As it is told to be, it is deeper than it can be where it jams.
        retreat = xp.maximum(memory.way - QUICKLY * period, back)
        drawn = there & (retreat <= back)
        one = 0.0 * come + 1.0
        # Where it has jammed it comes as carefully as to the mouth.
        edge = xp.maximum(memory.mouth, memory.jammed)
        outside = come <= edge + BACK
        press = self.press * xp.where(outside, LIGHTLY * one, one)
        feed = self.feed * xp.where(outside & (come > edge - GENTLY), SLOWLY * one, one)
        rate = feed * poses.clip(1.0 - self._push(force, weight, memory) / press, -1.0, 1.0)
        fed = xp.where(feeds, xp.minimum(memory.way + period * rate, memory.full + SLIPS), memory.way)
        draws = xp.isfinite(back)
        # It turns in the hand when it is lifted, and where it jams; and an arm is not quite where it is told
        # to be. Both is made up for, bit by bit, as long as nothing holds it.
        free = (rested >= 0.0) & (~memory.begun | draws)
        gain = xp.where(free, GAIN * one, 0.0 * one)
        return memory._replace(
            grip=poses.interpolate(memory.grip, self._regripped(now, come, memory), gain),
            weight=weights,
            felt=xp.where(jams[:, None], xp.zeros_like(felt), felt),
            begun=memory.begun | begins,
            lines=rested >= 0.0,
            way=poses.clip(xp.where(draws, retreat, fed), 0.0, math.inf),
            offset=offset,
            back=xp.where(draws & drawn, xp.full_like(back, math.inf), back),
            jammed=xp.where(jams, xp.maximum(come, memory.jammed), memory.jammed),
            tried=tried,
            best=xp.where(draws, come, xp.where(on, come, memory.best)),
            stuck=xp.where(jams, xp.zeros_like(stuck), stuck),
        )

    def _told(self, memory: InsertMemory) -> Array:
        """Poses ``(N, 7)`` where the object is told to be."""
        xp, start = array_namespace(memory.start), memory.start
        turn = poses.from_rotation_vector(memory.turn[:, None] * memory.inward)
        start = xp.concat([start[:, :3], poses.quat_multiply(turn, start[:, 3:])], axis=-1)
        return poses.shifted(start, memory.way[:, None] * memory.inward + memory.offset)

    def _regripped(self, now: Array, come: Array, memory: InsertMemory) -> Array:
        """The tool's pose ``(N, 7)`` in the object by which this would come to where it is told to be.

        How far it has come in does not count: it lags behind, and is held by what it touches.
        """
        told = self._told(memory)
        behind = (memory.way - come)[:, None] * memory.inward
        return poses.relative(poses.shifted(now, behind), poses.multiply(told, memory.grip))

    def _aside(
        self, force: Array, come: Array, tried: Array, memory: InsertMemory, period: float, places: Array
    ) -> tuple[Array, Array]:
        """Offsets ``(N, 3)`` for the next tick, and where they are those of the place that is tried.

        On its way from place to place it has to be free; in the hole it yields to forces from aside.
        """
        xp = array_namespace(force)
        index = xp.astype(poses.clip(tried, 0.0, len(places) - 1.0), xp.int64)
        goal = xp.stack([xp.take(constant(places[:, k], force), index) for k in (0, 1)], axis=-1)
        wanted = goal[:, :1] * memory.sides[:, 0, :] + goal[:, 1:] * memory.sides[:, 1, :] + memory.centre
        step, most = wanted - memory.offset, ASIDE * period
        length = poses.norm(step)
        share = xp.minimum(most / xp.maximum(length, xp.zeros_like(length) + 1e-9), xp.ones_like(length))
        free = xp.isfinite(memory.back) & (memory.way <= memory.back + 1e-9)
        searching = memory.offset + xp.where(free, share, 0.0 * share)[:, None] * step
        yields = yielding(memory.offset, force, memory.inward, wanted, period, most)
        inside = memory.begun & (come > memory.mouth + BACK) & ~xp.isfinite(memory.back)
        found = xp.where(inside[:, None], yields, searching)
        return found, free & (length <= most)

    def _push(self, force: Array, weight: Array, memory: InsertMemory) -> Array:
        """Force ``(N,)`` that resists on the way in, N."""
        return -poses.dot(force - weight, memory.inward)

    def _now(self, seen: Seen, memory: InsertMemory) -> Array:
        """Poses ``(N, 7)`` at which the object is taken to be."""
        return poses.multiply(seen.object(self.target), memory.lies)

    def _missing(self, seen: Seen, memory: InsertMemory) -> Array:
        """Metres ``(N,)`` that are missing to where it should end."""
        come = poses.dot(self._now(seen, memory)[:, :3] - memory.start[:, :3], memory.inward)
        return memory.full - come

    def planned(self, memory: InsertMemory) -> Array | float:
        """How long the way takes, where it was searched for."""
        return searched_for(memory.path)

    def limits(self, seen: Seen, memory: InsertMemory) -> tuple[Limit, ...]:
        """The force at the wrist; and all places about the mouth were tried."""
        names = {"object": self.target, "place": self.into}
        last = FEELS + float(len(places_to_try(seen.robot))) - 1.0
        return strain(seen, self.force_limit), Limit(JAMMED, memory.tried, last, names)

    def done(self, seen: Seen, memory: InsertMemory) -> Array:
        """It is where it should end, or near it and at the stop."""
        force = force_at_tool(seen)
        stops = self._push(force, memory.weight[:, :3], memory) > 0.5 * self.press
        missing = self._missing(seen, memory)
        return memory.begun & ((missing <= self.tolerance) | (stops & (missing <= NEAR)))

    def maintained(self, goal: str, seen: Seen, memory: InsertMemory) -> Array:
        """The object may still be in the hand."""
        return may_hold(seen, self.target)

    def necessary_cost(self, seen: Seen, memory: InsertMemory) -> Array:
        """Metres that are missing to where it should end."""
        return abs(self._missing(seen, memory))

    def sufficient_cost(self, known: Known, memory: InsertMemory) -> Array:
        """Metres that are missing in truth, over twice what is tolerated where a stop is felt."""
        come = poses.dot(known.object(self.target)[:, :3] - memory.start[:, :3], memory.inward)
        return abs(memory.full - come) / (2.0 * NEAR)

    def explain(self, seen: Seen, memory: InsertMemory) -> Statement:
        """How deep it is, what is missing, the force, and how many places were tried."""
        missing = self._missing(seen, memory)
        return PUSHED(
            object=self.target,
            place=self.into,
            depth=memory.full - memory.mouth - missing,
            missing=missing,
            force=force_at_wrist(seen),
            count=memory.tried,
        )
