"""Is something in a hole, or out of it, as far as is seen?"""

from __future__ import annotations

from typing import Any

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.parameters import Metres, ObjectName, PlaceName
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.whereabouts import Estimates
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES
from bt_tasksim.scene.hole_laws import InHole, beyond_hole, in_hole
from bt_tasksim.scene.specs import Goal

DEEP = Form(
    "{object} is {depth} deep in {hole}, {missing} from its stop and {aside} beyond its walls",
    {"depth": METRES, "missing": METRES, "aside": METRES},
)
OUT = Form("{object} is {gap} out of {hole}", {"gap": METRES})
SEEMS = 0.008
"""Metres by which what is in a hole may seem to be in its walls: estimates are as wrong as that."""


@register("concept")
class Inserted(Condition):
    """Is the object in the hole, as near to its stop as is asked?

    Args:
        target: The object.
        hole: The hole: a place of this kind.
        tolerance: How far it may be from the stop.
    """

    target: ObjectName
    hole: PlaceName
    tolerance: Metres = 0.012

    relation = "inserted"

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`; a goal's own tolerance counts where it is tighter."""
        asked: dict[str, Any] = {"target": goal.object, "hole": goal.place}
        if goal.position_tolerance != Goal.position_tolerance:
            asked["tolerance"] = min(goal.position_tolerance, cls.tolerance)
        return asked

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        found = self._found(seen)
        return (found.depth > 0.0) & (found.missing <= self.tolerance) & (found.aside <= SEEMS)

    def explain(self, seen: Seen) -> Statement:
        """How deep it is."""
        found = self._found(seen)
        return DEEP(
            object=self.target,
            hole=self.hole,
            depth=found.depth,
            missing=found.missing,
            aside=found.aside,
        )

    def _found(self, seen: Seen) -> InHole:
        key = ("in hole", self.target, self.hole)
        return seen.once(key, lambda: in_hole(Estimates.of(seen), self.target, self.hole))


@register("concept")
class OutOf(Condition):
    """Is the object out of the hole: is nothing of it between its walls?

    Args:
        target: The object.
        hole: The hole: a place of this kind.
        gap: How far from it the object has to be.
    """

    target: ObjectName
    hole: PlaceName
    gap: Metres = 0.002

    relation = "out_of"
    rests_on_place = False
    in_hand = True  # where it has come out, before the mouth, it would fall back

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return self._gap(seen) >= self.gap

    def explain(self, seen: Seen) -> Statement:
        """How far it is out."""
        return OUT(object=self.target, gap=self._gap(seen), hole=self.hole)

    def _gap(self, seen: Seen) -> Array:
        key = ("out of", self.target, self.hole)
        return seen.once(key, lambda: beyond_hole(Estimates.of(seen), self.target, self.hole))
