"""Anywhere: the object stands upright on a place or on another object, its middle within the edges.

What stands in a tray on the table, or on another object there, does not stand on the table.
"""

from __future__ import annotations

from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, RADIANS
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement, Presence
from bt_tasksim.scene.spatial_laws import is_on
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
ON_SOMETHING_ELSE = register_reason(
    "on_something_else", "{object} stands on something else that is on {place}, or in it"
)
TILTED_ON_IT = register_reason("tilted_on_it", "{object} is tilted on {place} by {angle}", angle=RADIANS)


@register("goal relation", "anywhere")
class Anywhere(GoalRelation):
    """See the file."""

    presence = Presence.BORNE

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        names = {"object": goal.object, "place": goal.place}
        found = is_on(final.whereabouts, goal.object, goal.place)
        aside, height, angle = (float(values[0]) for values in (found.aside, found.height, found.lean))
        missed = max(aside, abs(height))
        if bool(found.holds(goal.position_tolerance, goal.angle_tolerance)[0]):
            return Placement(True, STANDS_ANYWHERE(**names, angle=angle), missed, angle)
        if aside > 0.0 or abs(height) > goal.position_tolerance:
            return Placement(False, NOT_ON_IT(**names, aside=aside, height=height), missed, angle)
        if bool(found.elsewhere[0]):
            return Placement(False, ON_SOMETHING_ELSE(**names), missed, angle)
        return Placement(False, TILTED_ON_IT(**names, angle=angle), missed, angle)
