"""Conditions about things that are turned, tipped up, laid down or emptied."""

from __future__ import annotations

import math
from typing import Any

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.parameters import ObjectName, PlaceName, Radians
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.contents import seen_within
from bt_tasksim.concept_nodes.spin import LIKE, turned_off
from bt_tasksim.concept_nodes.whereabouts import Estimates
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array, array_namespace, host
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import COUNT, RADIANS
from bt_tasksim.scene.spatial_laws import BORNE, is_borne, is_on, rise_of_long_axis
from bt_tasksim.scene.specs import Goal

LEANS = Form("the long axis of {object} is {angle:.0f} from level{borne}", {"angle": RADIANS})
OTHERWISE = Form("{object} is turned by {angle:.0f} from {like}", {"angle": RADIANS})
AIR = ", and nothing is below it"
LEFT = Form("{count} things are in {object}", {"count": COUNT})


@register("concept")
class Emptied(Condition):
    """Is nothing seen in the hollow of the object?

    Args:
        target: The vessel.
    """

    target: ObjectName

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return self._count(seen) == 0

    def explain(self, seen: Seen) -> Statement:
        """How many things are in it."""
        return LEFT(object=self.target, count=self._count(seen))

    def _count(self, seen: Seen) -> Array:
        others = [name for name in seen.world.columns if name != self.target]
        xp = array_namespace(seen.tool)
        return xp.count_nonzero(seen_within(seen, self.target, others), axis=-1)


class _LongAxis(Condition):
    """A question about how the longest axis of what rests somewhere leans."""

    target: str
    on: str | None
    angle: float

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`; a goal's own tolerance counts where it is tighter."""
        asked: dict[str, Any] = {"target": goal.object}
        if goal.place:
            asked["on"] = goal.place
        if goal.angle_tolerance != Goal.angle_tolerance:
            asked["angle"] = min(goal.angle_tolerance, cls.angle)
        return asked

    def explain(self, seen: Seen) -> Statement:
        """How it leans."""
        borne = tuple("" if there else AIR for there in host(self._rests(seen)).tolist())
        return LEANS(object=self.target, angle=self._rise(seen), borne=borne)

    def _rise(self, seen: Seen) -> Array:
        return rise_of_long_axis(seen.object(self.target)[:, 3:], seen.model(self.target).extent)

    def _rests(self, seen: Seen) -> Array:
        where = Estimates.of(seen)
        if self.on is None:
            return is_borne(where, self.target)
        found = is_on(where, self.target, self.on)
        return (found.aside <= 0.0) & (abs(found.height) < BORNE) & ~found.elsewhere


@register("concept")
class OnEnd(_LongAxis):
    """Does the object stand on one of its ends: is its longest axis upright, and something below it?

    Args:
        target: The object.
        on: The place or the object on which it should stand; by default anything.
        angle: How far its axis may lean.
    """

    target: ObjectName
    on: PlaceName | None = None
    angle: Radians = 0.2

    relation = "on_end"

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return (math.pi / 2 - self._rise(seen) < self.angle) & self._rests(seen)


@register("concept")
class Lying(_LongAxis):
    """Does the object lie: is its longest axis level, and something below it?

    Args:
        target: The object.
        on: The place or the object on which it should lie; by default anything.
        angle: How far its axis may be from level.
    """

    target: ObjectName
    on: PlaceName | None = None
    angle: Radians = 0.2

    relation = "lying"

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return (self._rise(seen) < self.angle) & self._rests(seen)


@register("concept")
class TurnedLike(Condition):
    """Does the object have the heading of a place or of another object, up to its symmetry?

    Args:
        target: The object.
        like: The place, or the other object.
        angle: How far it may be turned or tilted from that.
    """

    target: ObjectName
    like: PlaceName
    angle: Radians = LIKE

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return turned_off(seen, self.target, self.like) < self.angle

    def explain(self, seen: Seen) -> Statement:
        """How far it is turned from that."""
        return OTHERWISE(object=self.target, angle=turned_off(seen, self.target, self.like), like=self.like)
