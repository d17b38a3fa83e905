"""Inside: the object is within a container, below its rim, whichever way up."""

from __future__ import annotations

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement
from bt_tasksim.scene.specs import Goal

IS_INSIDE = register_reason("is_inside", "{object} is in {place}, {distance} off its middle", distance=METRES)
NOT_INSIDE = register_reason(
    "not_inside", "{object} is not in {place}: {distance} off its middle", distance=METRES
)
SUNK = 0.01
"""Metres by which the object's centre may seem to be below the container's floor."""


@register("goal relation", "inside")
class Inside(GoalRelation):
    """See the file."""

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        place, local = final.place(goal.place), final.in_place(goal)[:3]
        within = all(abs(float(local[i]) - place.centre[i]) <= place.extent[i] / 2 for i in range(2))
        reached = within and -SUNK < float(local[2]) < place.height
        distance = float(np.linalg.norm(local[:2]))
        reason = IS_INSIDE if reached else NOT_INSIDE
        outcome = reason(object=goal.object, place=goal.place, distance=distance)
        return Placement(reached, outcome, distance, float(poses.tilt(final.pose(goal.object)[3:])))
