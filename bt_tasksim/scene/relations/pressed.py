"""Pressed: the hand holds the object on a place: its middle is over that one's, and it touches what is below.

With ``when="once"`` it says that a thing has come by there as something is wiped.
"""

from __future__ import annotations

import numpy as np

from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement, Presence, lean
from bt_tasksim.scene.specs import Goal

IS_PRESSED = register_reason(
    "is_pressed", "{object} is pressed on {place}, {distance} off its middle", distance=METRES
)
ELSEWHERE = register_reason(
    "not_pressed_there", "{object} is {distance} beside the middle of {place}", distance=METRES
)
NOT_TOUCHING = register_reason(
    "not_pressed_on", "{object} is not between the hand and {place}: it touches one of them at most"
)


@register("goal relation", "pressed")
class Pressed(GoalRelation):
    """See the file."""

    presence = Presence.THERE
    in_hand = True

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        names = {"object": goal.object, "place": goal.place}
        distance = float(np.linalg.norm(final.in_place(goal)[:2]))
        angle = lean(final.pose(goal.object)[3:], final.model(goal.object))
        if distance > goal.position_tolerance:
            return Placement(False, ELSEWHERE(**names, distance=distance), distance, angle)
        if not final.touched(goal.object) or not final.borne(goal.object):
            return Placement(False, NOT_TOUCHING(**names), distance, angle)
        return Placement(True, IS_PRESSED(**names, distance=distance), distance, angle)
