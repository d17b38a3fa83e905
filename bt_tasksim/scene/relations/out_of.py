"""Out of: nothing of the object is in a hole, between its walls; it may be held, or let go."""

from __future__ import annotations

import math

from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES
from bt_tasksim.scene.hole_laws import beyond_hole
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement
from bt_tasksim.scene.specs import Goal

IS_OUT = register_reason("is_out", "{object} is {gap} out of {place}", gap=METRES)
STILL_IN = register_reason("still_in", "{object} is still in {place}")


@register("goal relation", "out_of")
class OutOf(GoalRelation):
    """See the file."""

    may_be_held = True

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        gap = float(beyond_hole(final.whereabouts, goal.object, goal.place)[0])
        names = {"object": goal.object, "place": goal.place}
        outcome = IS_OUT(**names, gap=gap) if gap > 0.0 else STILL_IN(**names)
        return Placement(gap > 0.0, outcome, gap, math.nan)
