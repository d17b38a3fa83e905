"""Conditions about what is slid: against a stop, held there, clear of it, pressed on a place."""

from __future__ import annotations

import math
from typing import Any

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.parameters import Metres, ObjectName, PlaceName
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.destination import destination
from bt_tasksim.concept_nodes.holding import holding
from bt_tasksim.concept_nodes.stops import CLEAR, gaps
from bt_tasksim.concept_nodes.whereabouts import Estimates
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array, host
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES
from bt_tasksim.scene.spatial_laws import is_on
from bt_tasksim.scene.specs import Goal

AWAY = Form("{object} is {gap} from {other}{hand}", {"gap": METRES})
BESIDE = Form(
    "{object} is {distance} beside the middle of {place} and {height} above it{hand}",
    {"distance": METRES, "height": METRES},
)
LET_GO = ", and not in the hand"
TOUCHES = 0.01
"""Metres above a surface up to which something may seem to be that is pressed on it."""


class _FromWalls(Condition):
    """A question about the walls beside an object."""

    target: str
    other: str | None

    def explain(self, seen: Seen) -> Statement:
        """How far it is from them."""
        hand = _in_hand(seen, self.target) if self.in_hand else ""
        return AWAY(object=self.target, other=self.other or "any wall", gap=self._gap(seen), hand=hand)

    def _gap(self, seen: Seen) -> Array:
        """Metres ``(N,)`` to the nearest of them."""

        def find() -> Array:
            return gaps(seen.world, seen.objects, self.target, self.other)

        return seen.once(("stop", self.target, self.other), find)


@register("concept")
class Against(_FromWalls):
    """Does the object stand against a wall of a place's fixture, or the side of another object, as is seen?

    What is below it is no wall. Things that nearly touch may count as touching, by what estimates are wrong.

    Args:
        target: The object.
        other: The other object, or a place: then the furniture that it belongs to.
        tolerance: How far apart they may seem to be.
    """

    target: ObjectName
    other: PlaceName
    tolerance: Metres = 0.006

    relation = "against"
    rests_on_place = False

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return self._gap(seen) <= self.tolerance


@register("concept")
class HeldAgainst(Against):
    """Does the hand hold the object against a wall of a place's fixture, or the side of another object?

    Args:
        target: The object.
        other: The other object, or a place: then the furniture that it belongs to.
        tolerance: How far apart they may seem to be.
    """

    relation = "held_against"
    in_hand = True

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return holding(seen, self.target) & super().holds(seen)


@register("concept")
class ClearOf(_FromWalls):
    """Is there room between the object and the walls of a place's fixture, or the side of another object?

    Args:
        target: The object.
        other: The other object, or a place: then the furniture that it belongs to; by default anything.
        gap: How much at least.
    """

    target: ObjectName
    other: PlaceName | None = None
    gap: Metres = CLEAR

    relation = "clear_of"
    rests_on_place = False

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`."""
        return {"target": goal.object, "other": goal.place, "gap": goal.distance}

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return self._gap(seen) >= self.gap


@register("concept")
class PressedOn(Condition):
    """Does the hand hold the object on a place, over the middle of that?

    Args:
        target: The object.
        place: The place, or another object.
        tolerance: How far beside the middle it may be.
    """

    target: ObjectName
    place: PlaceName
    tolerance: Metres = 0.03

    relation = "pressed"
    in_hand = True
    takes_middle = True

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`; a goal's own tolerance counts where it is tighter."""
        asked: dict[str, Any] = {"target": goal.object, "place": goal.place}
        if goal.position_tolerance < cls.tolerance:
            asked["tolerance"] = goal.position_tolerance
        return asked

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        there = (self._aside(seen) <= self.tolerance) & (abs(self._height(seen)) <= TOUCHES)
        return there & holding(seen, self.target)

    def explain(self, seen: Seen) -> Statement:
        """Where it is."""
        return BESIDE(
            object=self.target,
            place=self.place,
            distance=self._aside(seen),
            height=poses.clip(self._height(seen), 0.0, math.inf),
            hand=_in_hand(seen, self.target),
        )

    def _aside(self, seen: Seen) -> Array:
        frame, _ = destination(seen, self.place)
        return poses.norm(poses.localise(frame, seen.object(self.target)[:, :3])[:, :2])

    def _height(self, seen: Seen) -> Array:
        key = ("is on", self.target, self.place)
        return seen.once(key, lambda: is_on(Estimates.of(seen), self.target, self.place)).height


def _in_hand(seen: Seen, target: str) -> tuple[str, ...]:
    return tuple("" if held else LET_GO for held in host(holding(seen, target)).tolist())
