"""Beside: the object stands upright at the level of another one, or of a place, and near it.

Near means that the two outlines from above are `Goal.distance` apart at most, and not in one another.
"""

from __future__ import annotations

from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, RADIANS
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement
from bt_tasksim.scene.spatial_laws import IN_ONE_ANOTHER, is_beside
from bt_tasksim.scene.specs import Goal

IS_BESIDE = register_reason("is_beside", "{object} stands {gap} beside {place}", gap=METRES)
TOO_FAR = register_reason(
    "too_far_beside", "{object} stands {gap} from {place}, more than {limit}", gap=METRES, limit=METRES
)
OVER_ONE_ANOTHER = register_reason(
    "over_one_another", "{object} and {place} are above one another by {depth}", depth=METRES
)
OTHER_LEVEL = register_reason(
    "other_level", "{object} does not stand at the level of {place}: {height} off", height=METRES
)
NOT_UPRIGHT = register_reason("not_upright", "{object} is tilted by {angle}", angle=RADIANS)


@register("goal relation", "beside")
class Beside(GoalRelation):
    """See the file."""

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        names = {"object": goal.object, "place": goal.place}
        found = is_beside(final.whereabouts, goal.object, goal.place)
        gap, height, lean, other_lean = (float(values[0]) for values in found)
        wrong = None
        if abs(height) > goal.position_tolerance:
            wrong = OTHER_LEVEL(**names, height=abs(height))
        elif gap < -IN_ONE_ANOTHER:
            wrong = OVER_ONE_ANOTHER(**names, depth=-gap)
        elif gap > goal.distance:
            wrong = TOO_FAR(**names, gap=gap, limit=goal.distance)
        elif not bool(found.holds(goal.distance, goal.position_tolerance, goal.angle_tolerance)[0]):
            tilted = goal.object if lean >= other_lean else goal.place
            wrong = NOT_UPRIGHT(object=tilted, angle=max(lean, other_lean))
        shown = max(gap, 0.0)
        return Placement(wrong is None, wrong or IS_BESIDE(**names, gap=shown), shown, lean)
