"""Inside: the object is within a container, below its rim, whichever way up; or within another object.

What is higher than a low container, such as a tray, stands on its floor.
"""

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
"""Metres by which the object's centre may seem to be below the container's floor, or it may stand off it."""


@register("goal relation", "inside")
class Inside(GoalRelation):
    """See the file."""

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        if final.is_object(goal.place):
            reached, distance = _in_object(goal, final)
        else:
            reached, distance = _in_place(goal, final)
        reason = IS_INSIDE if reached else NOT_INSIDE
        outcome = reason(object=goal.object, place=goal.place, distance=distance)
        return Placement(reached, outcome, distance, float(poses.tilt(final.pose(goal.object)[3:])))


def _in_place(goal: Goal, final: FinalState) -> tuple[bool, float]:
    place, local = final.place(goal.place), final.in_place(goal)[:3]
    within = all(abs(float(local[i]) - place.centre[i]) <= place.extent[i] / 2 for i in range(2))
    above = float(local[2])
    stands = abs(final.lowest(goal.object) - float(place.pose[2])) <= SUNK
    reached = within and (-SUNK < above < place.height or (above > 0.0 and stands))
    return reached, float(np.linalg.norm(local[:2]))


def _in_object(goal: Goal, final: FinalState) -> tuple[bool, float]:
    """The object's middle is within the box about the other one, however that lies."""
    local = poses.localise(final.pose(goal.place)[None], final.pose(goal.object)[None, :3])[0]
    within = bool(np.all(np.abs(local) <= np.array(final.model(goal.place).extent) / 2))
    return within, float(np.linalg.norm(local[:2]))
