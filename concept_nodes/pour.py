"""Pour: tilt a held vessel over another one until what is in it has fallen into that."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Metres, MetresPerSecond, Newtons, ObjectName, PlaceName, Radians
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.contents import known_within, outside, seen_within
from bt_tasksim.concept_nodes.holding import HOLDING, may_hold, not_held
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, strain
from bt_tasksim.concept_nodes.pouring import Tilt, pours_from, tilts
from bt_tasksim.concept_nodes.turning import led
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.outcomes import Form, Possible, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import COUNT, RADIANS
from bt_tasksim.core.world import Command
from bt_tasksim.planning.arm import LEANS
from bt_tasksim.planning.reach import reach_of
from bt_tasksim.planning.reference_motion import Path, at_times, plan, searched_for
from bt_tasksim.planning.route import Pace
from bt_tasksim.planning.routes import SAMPLES, with_routes

STUCK = register_reason(
    "stuck_in_vessel",
    "{value} things are still in {object}, tilted as far as it goes",
    value=COUNT,
    limit=COUNT,
)
SPILLED = register_reason("spilled", "{value} things have fallen beside {place}", value=COUNT, limit=COUNT)
TILTED = Form("{object} is tilted by {angle:.0f}, {left} things are in it", {"angle": RADIANS, "left": COUNT})

FAST, SLOW, GATHERS = 0.9, 0.3, 3.0
"""Radians a second at which it is tilted before anything can come out and back again, and from then on; and
the same for each second by which that changes."""
WAITS = 0.25
"""Seconds after something has come out for which it is tilted no farther."""
SURELY = 0.6
"""Seconds for which nothing is seen in it that it is turned back after."""
EMPTY = 1.0
"""Seconds for which it stays tilted where nothing was known to be in it."""
SHAKE, BEATS, PATIENCE = 0.06, 2.0, 5.0
"""Radians and times a second by which it is shaken where something stays in it, and seconds until that is
given up."""
EARLY = 0.25
"""Radians of tilt before the one at which something may come out from which on it is tilted slowly."""
LESS = (1.0, 0.88, 0.78)
"""Shares of the largest tilt that are tried, the next where the arm cannot turn so far."""
ENOUGH, TRIED = 3, 48
"""Ways to pour among which a search for a way chooses; and ways that are looked at."""
COARSE = 3
"""Every how many of its poses a grasp looks at."""
LANDED = 0.5
"""Seconds after it is upright again in which what fell has come to rest."""


class PourMemory(NamedTuple):
    """What a pouring remembers in ``N`` worlds.

    Attributes:
        path: Tool path to where the vessel is upright beside the other one.
        tilt: Tool path of tilting it: its time is the angle.
        careful: Angle ``(N,)`` from which on it is tilted slowly, radians.
        began: Booleans ``(N, n_objects)``: what was in it at the begin.
        angle: Angle ``(N,)`` that is commanded.
        rate: Radians a second ``(N,)`` at which that changes.
        left: Count ``(N,)`` of what was still in it at the last tick.
        calm: Seconds ``(N,)`` for which nothing has come out.
        waited: Seconds ``(N,)`` for which it has been tilted as far as it goes.
        back: Booleans ``(N,)``: it is turned back.
        upright: Seconds ``(N,)`` since it was upright again.
    """

    path: Path
    tilt: Path
    careful: Array
    began: Array
    angle: Array
    rate: Array
    left: Array
    calm: Array
    waited: Array
    back: Array
    upright: Array


@register("concept")
class Pour(ConceptModel[PourMemory]):
    """Tilt a held vessel over another one until it is empty (turns in the air: NC of rotation).

    The arm first brings it upright beside the other one, with its spout, or any of its rim, over that one's
    opening. It is tilted about a level axis, slowly from where something may come out, and waits while
    something does; what stays in it is shaken. Then it is turned upright again. What is in it is what is seen
    there; a vessel in which nothing is seen, or known, is tilted once.

    Args:
        target: The held vessel.
        into: The container, or the object with a hollow, into which it is emptied.
        most: How far it is tilted at most.
        height: How high its lip is over the other one's rim then.
        speed: Peak speed of the tool on its way there.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    into: PlaceName
    most: Radians = 2.3
    height: Metres = 0.03
    speed: MetresPerSecond = 0.3
    force_limit: Newtons = FORCE_LIMIT

    maintains = (HOLDING,)
    establishes = (ConditionOf("Emptied", target="target"),)
    requires = (ConditionOf("Lifted", target="target"),)
    contact = ContactChange(ContactState.NC, ContactState.NC, motion="rotation")
    presentation = Presentation(
        colour="#2a7fb8",
        spoken=r"pour|empt(?:y|ies)|tip .* out",
        sayings=("I pour it into the {}", "pour it out into the {}"),
        says_destination=True,
    )
    default_timeout = 60.0

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Into what."""
        return f"into {parameters['into']}" if "into" in parameters else ""

    def contradiction(self) -> str:
        """A vessel that is tilted by less than a right angle keeps what is in it."""
        if self.into == self.target:
            return "'into' is the vessel itself"
        return (
            ""
            if math.pi / 2 < self.most <= math.pi
            else "'most' should be between a right angle and a half turn"
        )

    def initial_state(self, seen: Seen) -> Possible:
        """The vessel must be in the hand."""
        return not_held(seen, self.target)

    def begin(self, seen: Seen) -> PourMemory:
        """Find a way to tilt it, and the way there.

        Raises:
            NoWayError: There is none in one of the worlds.
        """
        xp = array_namespace(seen.tool)
        found = [self._found(view) for view in views(seen)]
        joints = len(seen.robot.arm_joints)
        path = with_routes(
            plan([seen.tool], self.speed, samples=SAMPLES),
            {k: [route] for k, (route, *_) in enumerate(found)},
            joints,
        )
        tilt = _together([(tools, joints, angle) for _, tools, joints, angle, _ in found], seen.tool)
        careful = constant(np.array([careful for *_, careful in found]), seen.tool)
        began = seen_within(seen, self.target, self._others(seen))
        nothing = xp.zeros_like(careful)
        left = xp.sum(xp.astype(began, nothing.dtype), axis=-1)
        never = nothing > 1.0
        return PourMemory(
            path, tilt, careful, began, nothing, nothing, left, nothing, nothing, never, nothing
        )

    def _others(self, seen: Seen) -> list[str]:
        """Names of what may be in it, by column."""
        return [name for name in seen.world.columns if name not in (self.target, self.into)]

    def _found(self, view: WorldView) -> tuple[Any, Array, Array, float, float]:
        """The way there, and tool poses ``(n, 7)``, joints ``(n, n_arm)`` and the largest angle of the tilt.

        And the angle from which on something may come out.
        """
        grip = poses.relative(view.objects[self.target], view.tool)
        finder = view.finder([self.target], held=view.held(self.target))
        careful = pours_from(view, self.target, view.contents(self.target)) - EARLY
        for share in LESS:
            most = max(share * self.most, math.pi / 2 + 0.1)
            ways: list[tuple[Array, Tilt]] = []
            found = tilts(view, self.target, self.into, most, self.height)
            ends = poses.multiply(np.array([tilt.poses[[0, -1]] for tilt in found]), grip[None, None])
            near = ~reach_of(view.robot).beyond(ends.reshape(-1, 7), LEANS).reshape(-1, 2).any(axis=1)
            for k in np.flatnonzero(near)[:TRIED].tolist():
                tilt = found[k]
                tools = poses.multiply(tilt.poses, grip[None])
                joints = led(finder, tools[0], tools[1:])
                if joints is not None:
                    ways.append((joints, tilt))
                if len(ways) == ENOUGH:
                    break
            if ways:
                route = finder.search_posture(np.array([joints[0] for joints, _ in ways]), Pace(self.speed))
                ends = [float(np.abs(joints[0] - route.joints[-1]).max()) for joints, _ in ways]
                joints, tilt = ways[int(np.argmin(ends))]
                return route, poses.multiply(tilt.poses, grip[None]), joints, most, max(careful, 0.0)
        raise NoWayError(
            f"the arm cannot tilt {self.target} over {self.into} as it holds it: bring {self.into} nearer, "
            f"make room around it, or grasp {self.target} by its side"
        )

    def aim(self, view: WorldView) -> Aim | None:
        """Upright beside the other one, and tilted from there."""
        try:
            found = tilts(view, self.target, self.into, LESS[-1] * self.most, self.height)
        except NoWayError:
            return None
        some = found[:: max(1, len(found) // TRIED)]
        onwards = np.array([[*tilt.poses[COARSE::COARSE], tilt.poses[-1]] for tilt in some])
        first = np.array([tilt.poses[0] for tilt in some])
        return Aim(first, f"be tilted over {self.into}", on_the_way=True, onwards=onwards)

    def command(self, action: Array, seen: Seen, memory: PourMemory) -> Command:
        """Follow the way, then the tilt at its angle; the hand keeps its grip."""
        xp = array_namespace(seen.tool)
        tool, arm = at_times(memory.path, seen.elapsed)
        over, tilted = at_times(memory.tilt, memory.angle - self._shaken(memory))
        there = (seen.elapsed >= memory.path.duration)[:, None]
        assert arm is not None and tilted is not None, "there is a route in each world"
        return Command(tool=xp.where(there, over, tool), posture=xp.where(there, tilted, arm))

    def _shaken(self, memory: PourMemory) -> Array:
        """Radians ``(N,)`` by which it is tilted less for the moment."""
        xp = array_namespace(memory.angle)
        shaken = SHAKE * (1.0 - xp.cos(2.0 * math.pi * BEATS * memory.waited))
        return xp.where((memory.left > 0.0) & ~memory.back, shaken, xp.zeros_like(shaken))

    def advance(self, action: Array, seen: Seen, memory: PourMemory) -> PourMemory:
        """Go on with the tilt, wait, or turn back, by what is seen in the vessel."""
        xp, period = array_namespace(seen.tool), seen.world.control_period
        nothing, most = xp.zeros_like(memory.angle), memory.tilt.duration
        there = seen.elapsed >= memory.path.duration
        within = memory.began & seen_within(seen, self.target, self._others(seen))
        left = xp.sum(xp.astype(within, nothing.dtype), axis=-1)
        calm = xp.where(left < memory.left, nothing, memory.calm + period)
        tilted = there & (memory.angle >= most - 1e-6)
        waited = xp.where(tilted & ~memory.back, memory.waited + period, memory.waited)
        full = xp.any(memory.began, axis=-1)
        emptied = xp.where(full, (left == 0.0) & (calm >= SURELY), waited >= EMPTY)
        back = memory.back | (there & emptied)
        slow = xp.where(full & (calm < WAITS), nothing, xp.full_like(nothing, SLOW))
        ahead = xp.where(memory.angle < memory.careful, xp.full_like(nothing, FAST), slow)
        ahead = xp.minimum(ahead, _stopping(most - memory.angle))
        wanted = xp.where(back, -xp.minimum(xp.full_like(nothing, FAST), _stopping(memory.angle)), ahead)
        wanted = xp.where(there, wanted, nothing)
        rate = memory.rate + poses.clip(wanted - memory.rate, -GATHERS * period, GATHERS * period)
        angle = xp.minimum(poses.clip(memory.angle + period * rate, 0.0, math.inf), most)
        rate = xp.where((angle == memory.angle) & there, nothing, rate)
        upright = xp.where(back & (angle <= 1e-6), memory.upright + period, nothing)
        return memory._replace(
            angle=angle, rate=rate, left=left, calm=calm, waited=waited, back=back, upright=upright
        )

    def planned(self, memory: PourMemory) -> Array | float:
        """How long the way takes, where it was searched for."""
        return searched_for(memory.path)

    def limits(self, seen: Seen, memory: PourMemory) -> tuple[Limit, ...]:
        """The force at the wrist; what stays in the vessel; and what has fallen beside the other one."""
        xp = array_namespace(seen.tool)
        full = xp.any(memory.began, axis=-1)
        late = (memory.waited > PATIENCE) & ~memory.back & full
        landed = memory.upright >= LANDED
        beside = memory.left * 0.0
        if bool(xp.any(landed)):
            out = memory.began & outside(seen, self.into, self._others(seen))
            beside = xp.sum(xp.astype(out, beside.dtype), axis=-1)
        return (
            strain(seen, self.force_limit),
            Limit(STUCK, memory.left, 0.0, {"object": self.target}, counts=late),
            Limit(SPILLED, beside, 0.0, {"place": self.into}, counts=landed),
        )

    def done(self, seen: Seen, memory: PourMemory) -> Array:
        """It is upright again, and what fell is at rest."""
        return memory.upright >= LANDED

    def maintained(self, goal: str, seen: Seen, memory: PourMemory) -> Array:
        """The vessel may still be in the hand."""
        return may_hold(seen, self.target)

    def necessary_cost(self, seen: Seen, memory: PourMemory) -> Array:
        """How many things are still in the vessel."""
        return memory.left

    def sufficient_cost(self, known: Known, memory: PourMemory) -> Array:
        """How many of the things that were in the vessel are not in the other one."""
        xp = array_namespace(known.hidden.tool_pose)
        others = [name for name in known.world.columns if name not in (self.target, self.into)]
        missed = memory.began & ~known_within(known, self.into, others)
        return xp.sum(xp.astype(missed, known.hidden.tool_pose.dtype), axis=-1)

    def explain(self, seen: Seen, memory: PourMemory) -> Statement:
        """How far it is tilted, and what is still in it."""
        return TILTED(object=self.target, angle=memory.angle, left=memory.left)


def _stopping(way: Array) -> Array:
    """Radians a second ``(N,)`` from which a turn comes to rest within ``way (N,)`` radians."""
    xp = array_namespace(way)
    return xp.sqrt(2.0 * GATHERS * 0.6 * poses.clip(way, 0.0, math.inf)) + 0.02


def _together(found: list[tuple[Array, Array, float]], like: Array) -> Path:
    """Tool poses ``(n, 7)``, joints ``(n, n_arm)`` and lengths of several worlds as paths, evenly gone."""
    tables, postures = [], []
    for tools, joints, _ in found:
        at = np.linspace(0.0, len(tools) - 1.0, SAMPLES)
        i = np.minimum(at.astype(int), len(tools) - 2)
        share = at - i
        tables.append(poses.interpolate(tools[i], tools[i + 1], share))
        postures.append(joints[i] + share[:, None] * (joints[i + 1] - joints[i]))
    xp = array_namespace(like)
    length = constant(np.array([angle for *_, angle in found]), like)
    return Path(
        constant(np.array(tables), like),
        length,
        constant(np.array(postures), like),
        xp.ones_like(length) > 0.0,
    )
