"""Clear of: the object has come away from the walls of a place's fixture, or from the side of another object.

There are ``distance`` metres between them at least. In the hand it may still be.
"""

from __future__ import annotations

from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES
from bt_tasksim.scene.relations.against import gap_to_walls
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement, lean
from bt_tasksim.scene.specs import Goal

IS_CLEAR = register_reason("is_clear_of", "{object} is {gap} from the walls of {place}", gap=METRES)
NOT_CLEAR = register_reason(
    "not_clear_of",
    "{object} is {gap} from the walls of {place}, less than {wanted}",
    gap=METRES,
    wanted=METRES,
)
NOTHING_NEAR = register_reason("nothing_to_be_clear_of", "{place} has no wall beside {object}")


@register("goal relation", "clear_of")
class IsClearOf(GoalRelation):
    """See the file."""

    may_be_held = True

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        names = {"object": goal.object, "place": goal.place}
        found = gap_to_walls(goal, final)
        angle = lean(final.pose(goal.object)[3:], final.model(goal.object))
        if found is None:
            return Placement(True, NOTHING_NEAR(**names), 0.0, angle)
        gap, missing = max(found, 0.0), max(goal.distance - found, 0.0)
        if missing > 0.0:
            return Placement(False, NOT_CLEAR(**names, gap=gap, wanted=goal.distance), missing, angle)
        return Placement(True, IS_CLEAR(**names, gap=gap), 0.0, angle)
