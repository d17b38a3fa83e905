"""What tasks share that keep a held object in contact with what is below it while it moves along that."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bt_tasksim.concept.functions import booleans
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import MetresPerSecond, Newtons, ObjectName
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.closer import TOUCHING
from bt_tasksim.concept_nodes.hand_conditions import height_above
from bt_tasksim.concept_nodes.holding import HOLDING, may_hold, not_held
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, force_at_tool, strain
from bt_tasksim.concept_nodes.shoved_way import touching_now
from bt_tasksim.concept_nodes.standing import supports_of
from bt_tasksim.concept_nodes.surface import carrying
from bt_tasksim.concept_nodes.touching import touched
from bt_tasksim.concept_nodes.view import WorldView, host_numbers, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.outcomes import Form, Possible, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.transfer import fetched
from bt_tasksim.core.units import METRES, NEWTONS
from bt_tasksim.core.world import Command
from bt_tasksim.planning.reference_motion import Path, plan, sample
from bt_tasksim.planning.things import Leave

NOTHING_TO_SLIDE_ON = register_reason(
    "nothing_to_slide_on", "nothing that carries is known below {object}, along which it could slide"
)
NOT_FELT = register_reason(
    "surface_not_felt",
    "nothing is felt below {object} after {value} down, more than {limit}",
    value=METRES,
    limit=METRES,
)
SLID = Form(
    "{way} to go, {object} presses with {pressed:.1f}, {resisted:.1f} against the way{touch}",
    {"way": METRES, "pressed": NEWTONS, "resisted": NEWTONS},
)
YIELDS, SMOOTH = 0.0008, 0.3
"""Metres per second that the tool goes down for each newton that is missing; and the share of each reading of
the force in the smoothed one."""
SHARPLY = 0.5
"""The same of the force against the way, which says where a stop is."""
DOWN, SLOWLY = 0.04, 0.01
"""Metres per second at which it comes down, and with which at last, where the support is near."""
NEAR = 0.02
"""Metres above the support from which on it comes down slower."""
DEEPER = 0.03
"""Metres below where the support should be felt down to which it is looked for."""
LIGHT, BARELY = 0.3, 0.1
"""Shares of its force with which it has to press to go on; and where it may go down no farther."""
YIELDED = 0.006
"""Metres below where the support should be to which it presses on: what slips in the hand is not followed any
farther, since fingers would come down on the support."""
GOOD = 0.03
"""Metres from where it should end that are tolerable."""
HIGH = 0.15
"""Metres above its support from which something may come down on it to slide."""
ABOVE = 0.003
"""Metres above its support at which it is looked at before it slides: by a choice of a grasp, and where it is
to meet something."""
SHARES = (0.25, 0.5, 0.75, 1.0)
"""Shares of its way at which the arm has to be able to be for a grasp to be chosen."""
ENDED = 3
"""Ticks in a row for which what ends the task has to be so."""


class SlidMemory(NamedTuple):
    """What is remembered in ``N`` worlds.

    Attributes:
        path: The tool's path as if nothing had to come down.
        along: Unit vectors ``(N, 3)`` of the last piece of the way.
        baseline: Weight ``(N, 3)`` that hung in the hand at the begin, robot base frame, N.
        drop: Metres ``(N,)`` above its support at the begin.
        clear: Metres ``(N,)`` of the way up to which nothing is known to be in it.
        progress: Seconds ``(N,)`` of the path that have been commanded.
        lowered: Metres ``(N,)`` that the tool has been told to go down.
        pressed: Newtons ``(N,)`` with which it presses, smoothed.
        resisted: Newtons ``(N,)`` against the way, smoothed.
        found: Booleans ``(N,)``: the support has been felt.
        met: Booleans ``(N,)``: so much force has been against its way once that a stop may be there.
        ticks: Ticks ``(N,)`` in a row for which what ends the task has been so.
    """

    path: Path
    along: Array
    baseline: Array
    drop: Array
    clear: Array
    progress: Array
    lowered: Array
    pressed: Array
    resisted: Array
    found: Array
    met: Array
    ticks: Array


class Slid(ConceptModel[SlidMemory]):
    """A task in which the held ``target`` slides along what it is pressed on."""

    target: ObjectName
    press: Newtons
    speed: MetresPerSecond
    force_limit: Newtons = FORCE_LIMIT

    maintains = (HOLDING,)
    default_timeout = 20.0
    default_tolerance = 0.02

    def waypoints(self, seen: Seen, each: Sequence[WorldView]) -> Sequence[Array]:
        """Level displacements ``(N, 3)`` of the object from where it is, one after the other.

        Args:
            seen: What is seen.
            each: Each world of that by itself.
        """
        raise NotImplementedError

    def initial_state(self, seen: Seen) -> tuple[Possible, ...]:
        """The object must be in the hand, and a little above something that carries it at most."""
        held, found = not_held(seen, self.target), carrying(seen, self.target)
        high = height_above(seen, self.target, found.place.pose) > HIGH
        return held, NOTHING_TO_SLIDE_ON.where(~found.found | high, object=self.target)

    def begin(self, seen: Seen) -> SlidMemory:
        """The way along the support.

        Raises:
            NoWayError: It is not clear in one of the worlds.
        """
        xp, found = array_namespace(seen.tool), carrying(seen, self.target)
        drop = height_above(seen, self.target, found.place.pose)
        drop = xp.where(found.found & (drop > 0.0), drop, xp.zeros_like(drop))
        each = views(seen)
        points = [poses.shifted(seen.tool, by) for by in self.waypoints(seen, each)]
        before = points[-2] if len(points) > 1 else seen.tool
        way = points[-1][:, :3] - before[:, :3]
        length = poses.norm(way)
        along = way / xp.where(length > 1e-9, length, xp.ones_like(length))[:, None]
        (ranks,) = fetched([found.place.rank])
        drops, *ends = host_numbers([drop, *points])
        clear = [
            self._check(view, int(ranks[k]), float(drops[k]), [end[k] for end in ends])
            for k, view in enumerate(each)
        ]
        path = plan([seen.tool, *points], self.speed, blend=0.03, samples=65)
        nothing = xp.zeros_like(drop)
        return SlidMemory(
            path=path,
            along=along,
            baseline=xp.minimum(self._force(seen), nothing[:, None]) * constant([0.0, 0.0, 1.0], seen.tool),
            drop=drop,
            clear=constant(np.array(clear), drop),
            progress=nothing,
            lowered=nothing,
            pressed=nothing,
            resisted=nothing,
            found=booleans(seen.tool, False),
            met=booleans(seen.tool, False),
            ticks=xp.astype(nothing, xp.int64),
        )

    def _check(self, view: WorldView, rank: int, drop: float, way: Sequence[Array]) -> float:
        """The way is clear, seen where the object touches its support, and for so many metres.

        Raises:
            NoWayError: It is not.
        """
        names = list(view.world.places)
        supports = supports_of(view, names[rank]) if rank < len(names) else frozenset[str]()
        leave = Leave(held=supports | touching_now(view, self.target) | self._touches(view))
        finder = view.finder([self.target], held=view.held(self.target), leave=leave, closer=TOUCHING)
        down = np.array([0.0, 0.0, -drop])
        goes = self._until(view, drop, way)
        low = [poses.shifted(tool, down) for tool in (view.tool, *goes)]
        if finder.straight([view.tool, *low], leans=finder.leanings[-1]) is None:
            touches = [touch for tool in low for touch in finder.touched(tool)][:1]
            why = f"{touches[0][0]} would touch {touches[0][1]}" if touches else "the arm cannot follow"
            raise NoWayError(f"{self.target} cannot slide there: {why}")
        return float(sum(np.linalg.norm(b[:3] - a[:3]) for a, b in itertools.pairwise(low)))

    def _until(self, view: WorldView, drop: float, way: Sequence[Array]) -> Sequence[Array]:
        """The part of the way ``(7,)`` that it is going to go, as far as is known."""
        return way

    def _touches(self, view: WorldView) -> frozenset[str]:
        """Names of what else the object may touch on its way."""
        return frozenset()

    def command(self, action: Array, seen: Seen, memory: SlidMemory) -> Command:
        """Where the path is, and lower; the hand keeps its grip."""
        return self._commanded(memory, self.advance(action, seen, memory))

    def carry_out(self, action: Array, seen: Seen, memory: SlidMemory) -> tuple[Command, SlidMemory]:
        """Both, of one step."""
        after = self.advance(action, seen, memory)
        return self._commanded(memory, after), after

    def _commanded(self, memory: SlidMemory, after: SlidMemory) -> Command:
        tool = sample(memory.path, after.progress)
        down = constant([0.0, 0.0, -1.0], tool) * after.lowered[:, None]
        return Command(tool=poses.shifted(tool, down))

    def advance(self, action: Array, seen: Seen, memory: SlidMemory) -> SlidMemory:
        """Come down until the support is felt, then go on as it presses."""
        xp, period = array_namespace(seen.tool), seen.world.control_period
        force = self._force(seen) - memory.baseline
        pressed = memory.pressed + SMOOTH * (force[:, 2] - memory.pressed)
        against = -poses.dot(force, memory.along)
        resisted = memory.resisted + SHARPLY * (against - memory.resisted)
        found = memory.found | (force[:, 2] >= LIGHT * self.press)
        left = memory.drop - memory.lowered
        nearing = SLOWLY + (DOWN - SLOWLY) * poses.clip(left / NEAR, 0.0, 1.0)
        more = poses.clip(YIELDS * (self.press - pressed), -SLOWLY, SLOWLY)
        lowered = memory.lowered + period * xp.where(found, more, nearing)
        deepest = xp.maximum(memory.drop + YIELDED, memory.lowered)
        lowered = xp.where(found, xp.minimum(lowered, deepest), lowered)
        least = self.press * xp.where(
            lowered >= deepest, xp.full_like(left, BARELY), xp.full_like(left, LIGHT)
        )
        goes = found & (pressed >= least) & self._goes(xp.maximum(against, resisted))
        pace = xp.where(goes, self._pace(seen, memory), xp.zeros_like(pressed))
        progress = memory.progress + period * pace
        met = memory.met | ((memory.progress > 0.0) & ~self._goes(against))
        memory = memory._replace(
            progress=progress, lowered=lowered, pressed=pressed, resisted=resisted, found=found, met=met
        )
        ended = self._ended(seen, memory)
        return memory._replace(ticks=xp.where(ended, memory.ticks + 1, xp.zeros_like(memory.ticks)))

    def _pace(self, seen: Seen, memory: SlidMemory) -> Array:
        """Share ``(N,)`` of its path's speed at which it goes on."""
        return array_namespace(seen.tool).ones_like(memory.progress)

    def _goes(self, resisted: Array) -> Array:
        """Booleans ``(N,)``: it may go on along its way."""
        return resisted < math.inf

    def _ended(self, seen: Seen, memory: SlidMemory) -> Array:
        """Booleans ``(N,)``: the task is at its end, as far as this tick tells."""
        return memory.progress >= memory.path.duration

    def done(self, seen: Seen, memory: SlidMemory) -> Array:
        """What ends it has been so for some ticks."""
        return memory.ticks >= ENDED

    def limits(self, seen: Seen, memory: SlidMemory) -> tuple[Limit, ...]:
        """The force at the wrist; and a support that is not there."""
        deeper = memory.lowered - memory.drop
        names = {"object": self.target}
        return (
            strain(seen, self.force_limit),
            Limit(NOT_FELT, deeper, DEEPER, names, counts=~memory.found),
        )

    def maintained(self, goal: str, seen: Seen, memory: SlidMemory) -> Array:
        """The object may still be in the hand."""
        return may_hold(seen, self.target)

    def necessary_cost(self, seen: Seen, memory: SlidMemory) -> Array:
        """Metres that are left of the way."""
        return poses.norm((memory.path.table[:, -1, :3] - seen.tool[:, :3])[:, :2])

    def sufficient_cost(self, known: Known, memory: SlidMemory) -> Array:
        """What `missed` says of where it truly is; 1 at least unless it touches what it slides on."""
        xp, missed = array_namespace(known.hidden.tool_pose), self.missed(known)
        return xp.where(known.supported(self.target), missed, xp.maximum(missed, xp.ones_like(missed)))

    def missed(self, known: Known) -> Array:
        """How far ``(N,)`` the object truly is from where it should end, over what is tolerable."""
        raise NotImplementedError

    def explain(self, seen: Seen, memory: SlidMemory) -> Statement:
        """What is left of the way, and what is felt."""
        return SLID(
            way=self.necessary_cost(seen, memory),
            object=self.target,
            pressed=memory.pressed,
            resisted=memory.resisted,
            touch=touched(seen, self.target),
        )

    def _force(self, seen: Seen) -> Array:
        """Force at the wrist ``(N, 3)``, robot base frame, N."""
        return force_at_tool(seen)
