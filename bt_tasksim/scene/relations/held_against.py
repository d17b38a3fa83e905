"""Held against: as `against`, and the hand touches the object: true while it is pressed there."""

from __future__ import annotations

from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES
from bt_tasksim.scene.relations.against import IsAgainst
from bt_tasksim.scene.relations.base import FinalState, Placement
from bt_tasksim.scene.specs import Goal

NOT_PRESSED = register_reason("not_pressed", "the hand does not touch {object}")
HELD_AGAINST = register_reason("held_against", "{object} is held against {place}, {gap} apart", gap=METRES)


@register("goal relation", "held_against")
class IsHeldAgainst(IsAgainst):
    """See the file."""

    in_hand = True

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        found = super().evaluate(goal, final)
        if not found.reached:
            return found
        if not final.touched(goal.object):
            said = NOT_PRESSED(object=goal.object)
            return Placement(False, said, found.position_error, found.angle_error)
        said = HELD_AGAINST(object=goal.object, place=goal.place, gap=found.position_error)
        return Placement(True, said, found.position_error, found.angle_error)
