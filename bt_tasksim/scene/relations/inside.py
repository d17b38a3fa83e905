"""Inside: the object is within a container, below its rim, whichever way up; or in the hollow of an object.

What is higher than a low container, such as a tray, stands on its floor. The hollow of an object is where it
has a floor and walls all around, however it lies (`bt_tasksim.scene.hollows`): the opening of a handle is
none.
"""

from __future__ import annotations

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement, Presence
from bt_tasksim.scene.spatial_laws import beyond_walls
from bt_tasksim.scene.specs import Goal

IS_INSIDE = register_reason("is_inside", "{object} is in {place}, {distance} off its middle", distance=METRES)
NOT_INSIDE = register_reason(
    "not_inside",
    "{object} is not in {place}: {beyond} outside its walls or above its rim",
    beyond=METRES,
)


@register("goal relation", "inside")
class Inside(GoalRelation):
    """See the file."""

    presence = Presence.BORNE

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        beyond = float(beyond_walls(final.whereabouts, goal.object, goal.place)[0])
        reached = beyond <= 0.0
        frame = final.pose(goal.place) if final.is_object(goal.place) else final.place(goal.place).pose
        distance = float(np.linalg.norm(poses.localise(frame, final.pose(goal.object)[:3])[:2]))
        if reached:
            outcome = IS_INSIDE(object=goal.object, place=goal.place, distance=distance)
        else:
            outcome = NOT_INSIDE(object=goal.object, place=goal.place, beyond=beyond)
        return Placement(reached, outcome, distance, float(poses.tilt(final.pose(goal.object)[3:])))
