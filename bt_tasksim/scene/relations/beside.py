"""Beside: the object stands upright at the level of another one, or of a place, and near it.

Near means that the two outlines from above are `Goal.distance` apart at most, and not in one another.
"""

from __future__ import annotations

from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, RADIANS
from bt_tasksim.scene.outlines import distance
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement, lean
from bt_tasksim.scene.specs import Goal

IN_ONE_ANOTHER = 0.002
"""Metres by which the outlines may overlap: one may lean on the other."""
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
        gap = distance(final.outline(goal.object), final.outline(goal.place))
        height = final.lowest(goal.object) - final.lowest(goal.place)
        angles = {
            name: lean(final.pose(name)[3:], final.model(name))
            for name in (goal.object, goal.place)
            if final.is_object(name)
        }
        tilted = max(angles, key=lambda name: angles[name])
        wrong = None
        if abs(height) > goal.position_tolerance:
            wrong = OTHER_LEVEL(**names, height=abs(height))
        elif gap < -IN_ONE_ANOTHER:
            wrong = OVER_ONE_ANOTHER(**names, depth=-gap)
        elif gap > goal.distance:
            wrong = TOO_FAR(**names, gap=gap, limit=goal.distance)
        elif angles[tilted] > goal.angle_tolerance:
            wrong = NOT_UPRIGHT(object=tilted, angle=angles[tilted])
        shown = max(gap, 0.0)
        return Placement(wrong is None, wrong or IS_BESIDE(**names, gap=shown), shown, angles[goal.object])
