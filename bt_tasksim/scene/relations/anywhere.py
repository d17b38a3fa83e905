"""Anywhere: the object stands upright on a place or on another object, its middle within the edges."""

from __future__ import annotations

from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, RADIANS
from bt_tasksim.scene.outlines import distance, holds
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement, lean
from bt_tasksim.scene.specs import Goal

STANDS_ANYWHERE = register_reason(
    "stands_anywhere", "{object} stands on {place}, tilted by {angle}", angle=RADIANS
)
NOT_ON_IT = register_reason(
    "not_on_it",
    "{object} is not on {place}: {aside} beyond its edge, {height} above it",
    aside=METRES,
    height=METRES,
)
TILTED_ON_IT = register_reason("tilted_on_it", "{object} is tilted on {place} by {angle}", angle=RADIANS)


@register("goal relation", "anywhere")
class Anywhere(GoalRelation):
    """See the file."""

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        names = {"object": goal.object, "place": goal.place}
        at, edge = final.pose(goal.object)[None, :2], final.outline(goal.place)
        height = final.lowest(goal.object) - float(final.surface(goal.place)[2])
        aside = 0.0 if holds(edge, at) else distance(at, edge)
        angle = lean(final.pose(goal.object)[3:], final.model(goal.object))
        missed = max(aside, abs(height))
        if aside > 0.0 or abs(height) > goal.position_tolerance:
            return Placement(False, NOT_ON_IT(**names, aside=aside, height=height), missed, angle)
        if angle > goal.angle_tolerance:
            return Placement(False, TILTED_ON_IT(**names, angle=angle), missed, angle)
        return Placement(True, STANDS_ANYWHERE(**names, angle=angle), missed, angle)
