"""A goal relation from outside: an object stands near a place, and not on it."""

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES
from bt_tasksim.scene.relations import FinalState, GoalRelation, Placement
from bt_tasksim.scene.specs import Goal

IS_NEAR = register_reason("is_near", "{object} is {gap} from {place}", gap=METRES)
NOT_NEAR = register_reason("not_near", "{object} is not near {place}: {gap} off its edge", gap=METRES)


@register("goal relation", "near")
class Near(GoalRelation):
    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        place, local = final.place(goal.place), final.in_place(goal)
        middle, half = np.array(place.centre), np.array(place.extent) / 2
        gap = float(np.max(np.abs(local[:2] - middle) - half))
        reached = 0.0 < gap < goal.position_tolerance
        reason = IS_NEAR if reached else NOT_NEAR
        outcome = reason(object=goal.object, place=goal.place, gap=gap)
        return Placement(reached, outcome, abs(gap), float(poses.tilt(final.pose(goal.object)[3:])))
