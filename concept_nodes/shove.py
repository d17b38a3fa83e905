"""What push and pull share: a thing is moved along what it stands on, and led as it is seen to go."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.demonstrated import rounded
from bt_tasksim.concept.functions import booleans
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import (
    Direction,
    Metres,
    MetresPerSecond,
    Newtons,
    ObjectName,
    PlaceName,
    Position,
)
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes.destination import destination
from bt_tasksim.concept_nodes.holding import BETWEEN, REACH, holding, not_held, tool_distance
from bt_tasksim.concept_nodes.level_way import goal_words, level, not_level, not_one_goal
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, force_at_tool, force_at_wrist, strain
from bt_tasksim.concept_nodes.shoved_way import GAP, ShovedWay, shoved_way
from bt_tasksim.concept_nodes.surface import carrying
from bt_tasksim.concept_nodes.touching import touched
from bt_tasksim.concept_nodes.view import WorldView, host_numbers, views
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Possible, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.units import METRES, NEWTONS, RADIANS
from bt_tasksim.core.world import Command
from bt_tasksim.planning.reference_motion import Path, at_times, minimum_jerk, plan, searched_for
from bt_tasksim.planning.routes import SAMPLES, with_routes

HAND_FULL = register_reason(
    "hand_full", "there is something in the hand: put it down first, or name it as the 'tool'"
)
OTHER_HEIGHT = register_reason(
    "not_on_its_level",
    "the goal is {value} higher or lower than what {object} stands on, along which it would be moved",
    value=METRES,
)
NOTHING_UNDER_GOAL = register_reason(
    "nothing_under_goal",
    "{object} would be moved {aside} beyond the edge of what it stands on",
    aside=METRES,
)
ROLLS = register_reason(
    "rolls_away", "{object} is a ball, which rolls away where it is pushed: take it in the hand, and bring it"
)
TIPS = register_reason(
    "tipped_as_moved", "{object} is tilted by {value}, more than {limit}", value=RADIANS, limit=RADIANS
)
PASSED_BY = register_reason(
    "passed_by",
    "the hand has come {value} farther than {object}, more than {limit}: it has slid past it",
    value=METRES,
    limit=METRES,
)
DRIFTED = register_reason(
    "drifted_aside",
    "{object} has drifted {value} aside, more than {limit}: begin anew from where it is",
    value=METRES,
    limit=METRES,
)
NOT_BROUGHT = register_reason(
    "not_moved_there",
    "{object} lies {value:.3g} from where it was to be moved, more than {limit:.3g}",
    value=METRES,
    limit=METRES,
)
SHOVED = Form(
    "{object} is {distance} from its goal, {force} at the wrist{touch}",
    {"distance": METRES, "force": NEWTONS},
)
CLOSING = 0.5
"""Seconds in which the hand takes its shape before it comes."""
COMES_UPON = 0.05
"""Metres per second at which the pusher comes upon the thing."""
SLOWEST = 0.02
"""The same at the end of the way: what is pushed slides on for a millimetre or so."""
FASTER, SLOWER = 0.3, 0.15
"""Metres per second squared at which it becomes faster, and slower before the goal."""
STEEPEST = 0.5
"""How far it may go across the way for a metre along it, so as to lead back what has drifted."""
WIDE = 0.024
"""Metres over which a pusher has to touch the thing for a wide front: as two fingers apart do."""
LEADS = (0.5, 1.0)
"""How much of what the thing has drifted a narrow front, and a wide one, lead back on the rest of the way."""
FREE, FOLLOWS = (0.01, 0.02), 15.0
"""Metres beside the thing's middle up to which a narrow front, and a wide one, may come; and how far they go
back across the way for a metre along it for each metre more, 1/m."""
LOOKS_AHEAD = 0.04
"""Metres before the goal from which on what is left across the way counts as if they were left along it."""
NEAR = 0.003
"""Metres before the goal at which the push ends, since things go on for a little."""
BEYOND = 0.03
"""Metres by which the pusher may come farther than it should have to."""
BACK, UP = 0.4, 0.6
"""Seconds in which it goes back, and then up."""
ROCKS, STILL = math.radians(8.0), 2.0
"""Radians by which it may lean in the end otherwise than at the begin; and seconds after it has drawn back
for which what rocks may come to rest."""
TIPPED = math.radians(25.0)
"""Radians of tilt from which on what is pushed tips over."""
LEVEL = 0.02
"""Metres by which a goal may seem to be higher or lower than what the thing stands on."""


EMPTY = 0.9
"""Closure from which on nothing is between the fingers but each other."""
LAGS = 0.05
"""Metres by which the thing may lag behind the pusher."""
DRAWS = 0.05
"""Metres per second at which it draws a thing by its top."""
DOWN, YIELDS = 0.015, 0.0006
"""Metres per second at which it comes down on a thing from above; and that it goes on for each newton that is
missing there."""
SURELY, SMOOTH = 0.5, 0.25
"""Share of the force with which it is to press at which it draws; and of each reading in the smoothed one."""
DRIFTS = 0.04
"""Metres by which it may drift beside the straight way: more cannot be led back."""
LATE = 0.3
"""Seconds after it has drawn back until which the thing may still be seen to come to its goal."""
GOOD = 0.03
"""Metres from its goal within which it is where it should be."""
TOOL_LOST = register_reason(
    "tool_lost",
    "{object} is no longer in the hand: it is {value} from the tool, more than {limit}",
    value=METRES,
    limit=METRES,
)


class ShoveMemory(NamedTuple):
    """What is remembered in ``N`` worlds.

    Attributes:
        path: The tool's path to where it stands behind the thing.
        goal: Where the middle of that is to go ``(N, 3)``, metres.
        start: Its estimated pose ``(N, 7)`` at the begin.
        along: Level unit vectors ``(N, 3)`` of the way.
        short: Metres ``(N,)`` by which the way ends before the goal.
        away: Metres ``(N, 2)`` that the pusher goes back, and up, at the end.
        wide: 1 in worlds ``(N,)`` where the pusher has a wide front, else 0.
        hand: Closure ``(N,)`` with which it pushes.
        first: Closure ``(N,)`` at the begin.
        gap: Metres ``(N,)`` along the way that the tool goes before it meets the thing.
        above: 1 in worlds ``(N,)`` where it presses on the thing from above, else 0.
        gone: How far ``(N, 2)`` the tool has been told to go along the way and across it since it stood
            behind the thing, metres.
        lowered: How far ``(N,)`` it has been told to go down since then, metres.
        firm: Newtons ``(N,)`` that hold the tool up there, smoothed.
        pressed: Boolean ``(N,)``: it has felt the thing below it.
        speed: How fast ``(N, 2)``, m/s.
        ended: Seconds ``(N,)`` since the push ended; negative before.
    """

    path: Path
    goal: Array
    start: Array
    along: Array
    short: Array
    away: Array
    wide: Array
    hand: Array
    first: Array
    gap: Array
    above: Array
    gone: Array
    lowered: Array
    firm: Array
    pressed: Array
    speed: Array
    ended: Array


class Shove(ConceptModel[ShoveMemory]):
    """A task in which ``target`` is moved along what it stands on."""

    target: ObjectName
    to: PlaceName | None = None
    position: Position | None = None
    direction: Direction | None = None
    distance: Metres | None = None
    tool: ObjectName | None = None
    speed: MetresPerSecond = 0.12
    force_limit: Newtons = FORCE_LIMIT

    establishes = (ConditionOf("StandsOn", target="target", place="to", sometimes=True),)
    contact = ContactChange(ContactState.PC, ContactState.PC)
    default_timeout = 30.0
    default_tolerance = 0.012

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Where to, and with what."""
        tool = [f"with {parameters['tool']}"] if "tool" in parameters else []
        return ", ".join([*goal_words(parameters), *tool])

    @classmethod
    def from_task(cls, task: Task, later: Sequence[Task]) -> dict[str, Any]:
        """Where it goes, and what it is moved with."""
        given = task.parameters
        out: dict[str, Any] = {name: given[name] for name in ("target", "to", "tool") if given.get(name)}
        if "to" not in out:
            out["position"] = tuple(rounded(value) for value in given["position"])
        return out

    def contradiction(self) -> str:
        """One goal, and a way that is level."""
        goals = not_one_goal(self.to, self.position, self.direction, self.distance)
        wrong = goals or not_level(self.direction, "stands on")
        return wrong or ("'tool' is the target itself" if self.tool == self.target else "")

    def initial_state(self, seen: Seen) -> tuple[Possible, ...]:
        """The tool must be in the hand, or nothing; it is no ball, and its goal on its level."""
        rolls = ROLLS.where(seen.model(self.target).ball, object=self.target)
        now, goal = seen.object(self.target), self._goal(seen)
        higher = abs(goal[:, 2] - now[:, 2])
        other = OTHER_HEIGHT.where(higher > LEVEL, object=self.target, value=higher)
        below, aside = self._beyond(seen, goal)
        nothing = NOTHING_UNDER_GOAL.where(below & (aside > 0.0), object=self.target, aside=aside)
        if self.tool is not None:
            return not_held(seen, self.tool), rolls, other, nothing
        return HAND_FULL.where(self._full(seen)), rolls, other, nothing

    def _beyond(self, seen: Seen, goal: Array) -> tuple[Array, Array]:
        """Booleans ``(N,)``: it stands on a place; and metres ``(N,)`` of the goal beyond that one's edge."""
        xp, found = array_namespace(goal), carrying(seen, self.target)
        flat = abs(poses.localise(found.place.pose, goal)[:, :2] - found.place.centre)
        return found.found, xp.max(flat - found.place.extent / 2, axis=-1)

    def _full(self, seen: Seen) -> Array:
        """Boolean ``(N,)``: something is between the fingers."""
        full = seen.closure < 0.0
        for name, column in seen.world.columns.items():
            full = full | (seen.world.object_facts.present[:, column] & holding(seen, name, BETWEEN))
        return full & (seen.closure < EMPTY)

    def _goal(self, seen: Seen) -> Array:
        """Where the middle of the thing is to go ``(N, 3)``, metres."""
        now, xp = seen.object(self.target)[:, :3], array_namespace(seen.tool)
        if self.to is not None:
            (frame, _), below = destination(seen, self.to), carrying(seen, self.target)
            height = poses.localise(below.place.pose, now)[:, 2]
            up = xp.where(below.found, height, seen.model(self.target).standing_height)
            return poses.transform(frame, xp.stack([0.0 * up, 0.0 * up, up], axis=-1))
        if self.position is not None:
            flat = xp.zeros_like(now[:, :2]) + constant(self.position[:2], now)
            return xp.concat([flat, now[:, 2:]], axis=-1)
        assert self.direction is not None and self.distance is not None
        return now + level(self.direction, self.distance, now)

    def begin(self, seen: Seen) -> ShoveMemory:
        """How the pusher stands behind the thing, and its way there.

        Raises:
            NoWayError: In one of the worlds it cannot.
        """
        xp, now = array_namespace(seen.tool), seen.object(self.target)
        goal = self._goal(seen)
        goal = xp.concat([goal[:, :2], now[:, 2:3]], axis=-1)
        missed = poses.norm((goal - now[:, :3])[:, :2])
        goals, is_there = host_numbers([goal, xp.astype(missed <= self.tolerance, now.dtype)])
        found = {k: self._way(view, goals[k]) for k, view in enumerate(views(seen)) if not is_there[k] > 0.0}
        path = plan([seen.tool], self.speed, samples=SAMPLES)
        path = with_routes(path, {k: [way.route] for k, way in found.items()}, len(seen.robot.arm_joints))
        numbers = np.array([_numbers(found[k]) if k in found else _NOTHING for k in range(len(goals))])
        short, back, up, wide, hand, gap, above = (
            constant(numbers[:, k].copy(), now) for k in range(numbers.shape[1])
        )
        way = goal - now[:, :3]
        length = poses.norm(way)
        along = way / xp.where(length > 1e-9, length, xp.ones_like(length))[:, None]
        nothing = xp.zeros_like(now[:, :2])
        before = xp.where(missed <= self.tolerance, nothing[:, 0] + (BACK + UP), nothing[:, 0] - 1.0)
        return ShoveMemory(
            path=path,
            goal=goal,
            start=now,
            along=along,
            short=short,
            away=xp.stack([back, up], axis=-1),
            wide=wide,
            hand=xp.where(hand < 0.0, seen.closure, hand),
            first=seen.closure,
            gap=gap,
            above=above,
            gone=nothing,
            lowered=nothing[:, 0],
            firm=nothing[:, 0],
            pressed=booleans(seen.tool, False),
            speed=nothing,
            ended=before,
        )

    def _way(self, view: WorldView, goal: Array) -> ShovedWay:
        return shoved_way(view, self.target, goal, self.tool, self.tolerance)

    def command(self, action: Array, seen: Seen, memory: ShoveMemory) -> Command:
        """Come behind the thing, move it, and draw back."""
        return self._commanded(seen, memory, self.advance(action, seen, memory))

    def carry_out(self, action: Array, seen: Seen, memory: ShoveMemory) -> tuple[Command, ShoveMemory]:
        """Both, of one step."""
        after = self.advance(action, seen, memory)
        return self._commanded(seen, memory, after), after

    def _commanded(self, seen: Seen, memory: ShoveMemory, after: ShoveMemory) -> Command:
        xp = array_namespace(seen.tool)
        coming, arm = at_times(memory.path, self._since(seen))
        across = _across(memory.along)
        gone = after.gone[:, :1] * memory.along + after.gone[:, 1:] * across
        back = minimum_jerk(poses.clip(after.ended / BACK, 0.0, 1.0)) * memory.away[:, 0]
        up = minimum_jerk(poses.clip((after.ended - BACK) / UP, 0.0, 1.0)) * memory.away[:, 1]
        upward = constant([0.0, 0.0, 1.0], gone) + xp.zeros_like(gone)
        gone = gone - back[:, None] * memory.along + (up - after.lowered)[:, None] * upward
        there = ~self._begun(seen, memory)
        tool = xp.where(there[:, None], coming, poses.shifted(coming, gone))
        posture = None if arm is None else xp.where(there[:, None], arm, xp.full_like(arm, xp.nan))
        if self.tool is not None:
            return Command(tool=tool, posture=posture)
        share = poses.clip(seen.elapsed / (0.6 * CLOSING), 0.0, 1.0)
        hand = memory.first + share * (memory.hand - memory.first)
        return Command(tool=tool, hand=hand[:, None], posture=posture)

    def _since(self, seen: Seen) -> Array:
        """Seconds ``(N,)`` for which it has been coming."""
        closing = CLOSING if self.tool is None else 0.0
        return poses.clip(seen.elapsed - closing, 0.0, math.inf)

    def _begun(self, seen: Seen, memory: ShoveMemory) -> Array:
        """Boolean ``(N,)``: it stands behind the thing."""
        return self._since(seen) >= memory.path.duration

    def advance(self, action: Array, seen: Seen, memory: ShoveMemory) -> ShoveMemory:
        """Go on along the way, and across it as far as the thing has drifted."""
        xp, period = array_namespace(seen.tool), seen.world.control_period
        ahead, aside = self._left(seen, memory)
        ahead = ahead - memory.short
        begun = self._begun(seen, memory)
        far = memory.gone[:, 0] >= memory.gap + self._length(memory) + BEYOND
        ends = begun & (memory.ended < 0.0) & ((ahead <= NEAR) | far)
        going = begun & (memory.ended < 0.0) & ~ends
        nothing = xp.zeros_like(ahead)
        from_above = memory.above > 0.0
        firm = memory.firm + xp.where(going, SMOOTH * (self._felt(seen) - memory.firm), nothing)
        touched = memory.pressed | (going & from_above & (self._felt(seen) >= SURELY * self._press))
        down = xp.where(going & from_above, self._lowering(firm, touched), nothing)
        going = going & ((touched & (firm >= SURELY * self._press)) | ~from_above)
        slowing = xp.sqrt(SLOWEST**2 + 2.0 * SLOWER * xp.maximum(ahead - NEAR, nothing))
        pace = xp.minimum(slowing, xp.full_like(slowing, self.speed))
        pace = xp.where(from_above, xp.minimum(pace, xp.full_like(pace, DRAWS)), pace)
        comes = memory.gone[:, 0] < memory.gap
        pace = xp.where(comes, xp.minimum(pace, xp.full_like(pace, COMES_UPON)), pace)
        before, most = memory.speed, FASTER * period
        pace = poses.clip(pace, before[:, 0] - 2.0 * most, before[:, 0] + most)
        slope = poses.clip(self._slope(ahead, aside, memory), -STEEPEST, STEEPEST)
        across = xp.where(comes, nothing, pace * slope)
        across = poses.clip(across, before[:, 1] - most, before[:, 1] + most)
        speed = xp.where(going[:, None], xp.stack([pace, across], axis=-1), xp.zeros_like(before))
        begins = xp.where(ends, nothing, memory.ended)
        ended = xp.where(memory.ended >= 0.0, memory.ended + period, begins)
        gone = memory.gone + period * speed
        lowered = memory.lowered + period * down
        return memory._replace(
            gone=gone, speed=speed, ended=ended, lowered=lowered, firm=firm, pressed=touched
        )

    @property
    def _press(self) -> float:
        """Newtons with which it presses on a thing from above."""
        return 0.0

    def _felt(self, seen: Seen) -> Array:
        """Newtons ``(N,)`` that hold the tool up."""
        return force_at_tool(seen)[:, 2]

    def _lowering(self, firm: Array, touched: Array) -> Array:
        """Metres per second ``(N,)`` at which the tool goes down: to the thing, then as it presses."""
        xp = array_namespace(firm)
        more = poses.clip(YIELDS * (self._press - firm), -DOWN, DOWN)
        return xp.where(touched, more, xp.full_like(more, DOWN))

    def _slope(self, ahead: Array, aside: Array, memory: ShoveMemory) -> Array:
        """How far ``(N,)`` the pusher is to go across the way for a metre along it.

        It takes the thing along by friction as it goes across; what has slid or turned away to one side, it
        has to follow there.
        """
        xp, beside = array_namespace(ahead), memory.gone[:, 1] + aside
        free = FREE[0] + (FREE[1] - FREE[0]) * memory.wide
        off = xp.sign(beside) * xp.maximum(abs(beside) - free, xp.zeros_like(free))
        lead = LEADS[0] + (LEADS[1] - LEADS[0]) * memory.wide
        return lead * aside / poses.clip(ahead, LOOKS_AHEAD, math.inf) - FOLLOWS * off

    def _left(self, seen: Seen, memory: ShoveMemory) -> tuple[Array, Array]:
        """How far ``(N,)`` the thing still has to go along the way, and across it, metres."""
        off = memory.goal - seen.object(self.target)[:, :3]
        return poses.dot(off, memory.along), poses.dot(off, _across(memory.along))

    def _length(self, memory: ShoveMemory) -> Array:
        return poses.dot(memory.goal - memory.start[:, :3], memory.along)

    def planned(self, memory: ShoveMemory) -> Array | float:
        """How long the way takes, where it was searched for."""
        return searched_for(memory.path)

    def limits(self, seen: Seen, memory: ShoveMemory) -> tuple[Limit, ...]:
        """The force at the wrist; the thing tips over, lags behind, or is elsewhere in the end."""
        names = {"object": self.target}
        tilt = poses.tilt(seen.object(self.target)[:, 3:], memory.start[:, 3:])
        ahead, aside = self._left(seen, memory)
        behind = memory.gone[:, 0] - memory.gap - (self._length(memory) - ahead)
        late = memory.ended >= BACK + UP + LATE
        return (
            strain(seen, self.force_limit),
            Limit(TIPS, tilt, TIPPED, names),
            Limit(PASSED_BY, behind, LAGS, names, counts=memory.ended < 0.0),
            Limit(DRIFTED, abs(aside), DRIFTS, names, counts=memory.ended < 0.0),
            Limit(NOT_BROUGHT, self._missed(seen, memory), self.tolerance, names, counts=late),
            Limit(TIPS, self._rocks(seen, memory), ROCKS, names, counts=memory.ended >= BACK + UP + STILL),
            *(self._lost(seen) if self.tool is not None else ()),
        )

    def _rocks(self, seen: Seen, memory: ShoveMemory) -> Array:
        """Radians ``(N,)`` by which the thing leans otherwise than at the begin, whichever way it faces."""
        now, before = (
            poses.rotate(q, constant([0.0, 0.0, 1.0], q))[:, 2]
            for q in (seen.object(self.target)[:, 3:], memory.start[:, 3:])
        )
        xp = array_namespace(now)
        lean, leant = (xp.acos(poses.clip(up, -1.0, 1.0)) for up in (now, before))
        return abs(lean - leant)

    def _lost(self, seen: Seen) -> tuple[Limit, ...]:
        assert self.tool is not None
        return (Limit(TOOL_LOST, tool_distance(seen, self.tool), REACH, {"object": self.tool}),)

    def done(self, seen: Seen, memory: ShoveMemory) -> Array:
        """The pusher has drawn back, and the thing is where it should be."""
        still = self._rocks(seen, memory) <= ROCKS
        return (memory.ended >= BACK + UP) & still & (self._missed(seen, memory) <= self.tolerance)

    def _missed(self, seen: Seen, memory: ShoveMemory) -> Array:
        """Metres ``(N,)`` that the thing's middle is beside its goal, seen from above."""
        return poses.norm((memory.goal - seen.object(self.target)[:, :3])[:, :2])

    def necessary_cost(self, seen: Seen, memory: ShoveMemory) -> Array:
        """Metres that the thing's middle is beside its goal."""
        return self._missed(seen, memory)

    def sufficient_cost(self, known: Known, memory: ShoveMemory) -> Array:
        """How far the thing truly is from its goal over `GOOD`; 10 where it stands on nothing."""
        missed = poses.norm((memory.goal - known.object(self.target)[:, :3])[:, :2]) / GOOD
        xp = array_namespace(missed)
        return xp.where(known.supported(self.target), missed, xp.full_like(missed, 10.0))

    def explain(self, seen: Seen, memory: ShoveMemory) -> Statement:
        """How far the thing is from its goal, and the force at the wrist."""
        return SHOVED(
            object=self.target,
            distance=self._missed(seen, memory),
            force=force_at_wrist(seen),
            touch=touched(seen, self.target),
        )


def _numbers(way: ShovedWay) -> tuple[float, ...]:
    wide = float(way.stance.width >= WIDE)
    gap = 0.0 if way.above else GAP
    return (way.short, *way.away, wide, way.stance.closure, gap, float(way.above))


_NOTHING = (0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0)
"""The same where the thing is at its goal already; the hand stays as it is."""


def _across(along: Array) -> Array:
    """Level unit vectors ``(N, 3)`` to the left of others."""
    return poses.cross(constant([0.0, 0.0, 1.0], along) + 0.0 * along, along)
