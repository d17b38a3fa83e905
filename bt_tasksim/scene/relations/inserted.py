"""Inserted: the object is in a hole, between its walls, down to the stop or nearly so."""

from __future__ import annotations

import math

from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES
from bt_tasksim.scene.hole_laws import in_hole
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement, Presence
from bt_tasksim.scene.specs import Goal

IS_INSERTED = register_reason(
    "is_inserted",
    "{object} is {depth} deep in {place}, {missing} from its stop",
    depth=METRES,
    missing=METRES,
)
NOT_INSERTED = register_reason(
    "not_inserted",
    "{object} is not in {place}: {depth} deep, {missing} from its stop, {aside} beyond its walls",
    depth=METRES,
    missing=METRES,
    aside=METRES,
)


@register("goal relation", "inserted")
class Inserted(GoalRelation):
    """See the file; `Goal.position_tolerance` is how far it may be from the stop."""

    presence = Presence.WITHIN
    position_tolerance = 0.01

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        found = in_hole(final.whereabouts, goal.object, goal.place)
        depth, missing, aside = (float(values[0]) for values in found)
        reached = bool(found.holds(goal.position_tolerance)[0])
        said = {"object": goal.object, "place": goal.place, "depth": depth, "missing": missing}
        outcome = IS_INSERTED(**said) if reached else NOT_INSERTED(**said, aside=max(aside, 0.0))
        axes = poses.to_matrix(poses.relative(final.place(goal.place).pose, final.pose(goal.object))[3:])
        angle = math.acos(min(1.0, float(abs(axes[2]).max())))
        return Placement(reached, outcome, abs(missing), angle)
