"""Slide to a stop: move a held object along what it is pressed on until something holds it up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.demonstrated import straight_words
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.parameters import Direction, Metres, MetresPerSecond, Newtons, ObjectName, PlaceName
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.level_way import not_level
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT
from bt_tasksim.concept_nodes.shoved_way import free_until
from bt_tasksim.concept_nodes.slid import ABOVE, SHARES, Slid, SlidMemory
from bt_tasksim.concept_nodes.standing import supports_of
from bt_tasksim.concept_nodes.stops import UP, gaps, no_way_named, way_in, ways_in
from bt_tasksim.concept_nodes.tipping import support_of
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import SECONDS
from bt_tasksim.core.world import FURNITURE
from bt_tasksim.planning.reference_motion import position
from bt_tasksim.scene.walls import CLOSE

NO_STOP = register_reason(
    "no_stop",
    "nothing has held {object} up on all of its way, {value} after that's end, more than {limit}",
    value=SECONDS,
    limit=SECONDS,
)
BEYOND = 0.004
"""Metres beyond where it meets something at which the hand has to be clear of that, so that no finger is in
front of the object: of things and of how they lie in the hand some is not known.
"""
BEFORE, CREEPS, PRESSES = 0.025, 0.015, 0.005
"""Metres before where it is known to meet something from which on it goes so slowly, m/s; and how slowly it
goes on once it has met something."""
LATE = 0.5
"""Seconds after its way's end until which it may still be held up."""


@register("concept")
class SlideToStop(Slid):
    """Slide a held object along what it is pressed on against a stop (makes contact: TR to OT).

    It comes down until the wrist feels what is below, and goes along it, slowly, until the force against its
    way says that an edge, a wall or another thing holds it up.

    Args:
        target: The held object.
        direction: Which way it goes, robot base frame, level; by default to the nearest wall of ``against``.
        distance: How far it goes at most: the stop should be nearer.
        against: The place or the object that it comes to stand against, which it may touch.
        resistance: Force against the way that counts as the stop: more than friction.
        press: Force with which it presses on what it slides on.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    direction: Direction | None = None
    distance: Metres = 0.2
    against: PlaceName | None = None
    resistance: Newtons = 10.0
    press: Newtons = 4.0
    speed: MetresPerSecond = 0.06
    force_limit: Newtons = FORCE_LIMIT

    establishes = (
        ConditionOf("HeldAgainst", target="target", other="against"),
        ConditionOf("Against", target="target", other="against"),
    )
    contact = ContactChange(ContactState.TR, ContactState.OT)
    presentation = Presentation(
        colour="#3a6f8f",
        spoken=r"against|up to the (?:edge|wall|stop)|until it stops",
        sayings=("slide it against the wall", "up to the stop", "until it stops"),
    )

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Which way, and how far at most."""
        return straight_words(parameters) if {"direction", "distance"} <= parameters.keys() else ""

    def contradiction(self) -> str:
        """A way that is level, or where it ends."""
        return not_level(self.direction) or no_way_named(self.direction, self.against, "against")

    def waypoints(self, seen: Seen, each: Sequence[WorldView]) -> Sequence[Array]:
        """See `Slid.waypoints`."""
        ways = ways_in(each, self.target, self.direction, self.against, self.distance)
        return (self.distance * constant(ways, seen.tool),)

    def aim(self, view: WorldView) -> Aim | None:
        """To where it is known to meet something, if it does."""
        along = way_in(view, self.target, self.direction, self.against)
        if along is None:
            return None
        share = free_until(view, self.target, ABOVE * UP, self.distance * along)
        if share >= 1.0:
            return None
        now = poses.shifted(view.objects[self.target], ABOVE * UP)
        beyond = share * self.distance + BEYOND
        way = [poses.shifted(now, part * beyond * along) for part in SHARES]
        supports = self._touches(view).union(support_of(view, self.target)[0])
        return Aim(np.array(way), "be slid against a stop", supports, along=True)

    def _until(self, view: WorldView, drop: float, way: Sequence[Array]) -> Sequence[Array]:
        """To where it meets something: the hand has to be clear of that."""
        (end,) = way
        down = np.array([0.0, 0.0, ABOVE - drop])
        reached = free_until(view, self.target, down, end[:3] - view.tool[:3])
        return (poses.shifted(view.tool, reached * (end[:3] - view.tool[:3])),)

    def _touches(self, view: WorldView) -> frozenset[str]:
        """The stop, wherever it is; where it is not named, any furniture and any object may be it."""
        if self.against is not None:
            return frozenset({self.against}) | supports_of(view, self.against)
        return frozenset({*view.objects, *(box.fixture or FURNITURE for box in view.world.obstacles)})

    def _pace(self, seen: Seen, memory: SlidMemory) -> Array:
        """Slowly from a little before where it is known to meet something, or all the way where nothing is.

        What is met fast presses hard; and what has been felt once is there.
        """
        xp, period = array_namespace(seen.tool), seen.world.control_period
        here, ahead = (position(memory.path, memory.progress + later) for later in (0.0, period))
        speed = poses.norm(ahead - here) / period
        gone = poses.norm(here - memory.path.table[:, 0, :3])
        near = gone >= _whole(memory) - _slow(memory)
        creeps, presses = (xp.full_like(speed, most) for most in (CREEPS, PRESSES))
        most = xp.where(memory.met, presses, xp.where(near, creeps, speed + creeps))
        return xp.minimum(most / xp.maximum(speed, most), xp.ones_like(speed))

    def missed(self, known: Known) -> Array:
        """The true gap to the stop, over what counts as touching."""
        return gaps(known.world, known.hidden.objects, self.target, self.against) / CLOSE

    def planned(self, memory: SlidMemory) -> Array | float:
        """How long what it goes slowly takes, twice: it waits where it does not press."""
        return 2.0 * _slow(memory) / CREEPS

    def _goes(self, resisted: Array) -> Array:
        return resisted < self.resistance

    def _ended(self, seen: Seen, memory: SlidMemory) -> Array:
        return memory.found & (memory.resisted >= self.resistance)

    def limits(self, seen: Seen, memory: SlidMemory) -> tuple[Limit, ...]:
        """The force at the wrist; a support that is not there; and no stop on all of the way."""
        late = memory.progress - memory.path.duration
        return (*super().limits(seen, memory), Limit(NO_STOP, late, LATE, {"object": self.target}))


def _whole(memory: SlidMemory) -> Array:
    """Metres ``(N,)`` of the way."""
    return poses.norm(memory.path.table[:, -1, :3] - memory.path.table[:, 0, :3])


def _slow(memory: SlidMemory) -> Array:
    """Metres ``(N,)`` of the way, its last ones, along which it goes slowly; all where no stop is known."""
    xp, whole = array_namespace(memory.clear), _whole(memory)
    left = xp.minimum(whole - memory.clear + BEFORE, whole)
    return xp.where(memory.clear > whole - BEFORE, whole, left)
