"""On: the object stands upright on the origin of a place, with its heading up to the object's symmetry.

Or on another object: on the middle of its top, wherever that is, with any heading. Of small things one that
stands next to another one, or on a third one, may be within the tolerance: it does not stand on it.
"""

from __future__ import annotations

import numpy as np

from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, RADIANS
from bt_tasksim.scene.relations.anywhere import ON_SOMETHING_ELSE
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement, Presence, lean, turn
from bt_tasksim.scene.spatial_laws import is_on
from bt_tasksim.scene.specs import Goal

STANDS = register_reason(
    "stands", "{object} stands on {place}, {distance} and {angle} off", distance=METRES, angle=RADIANS
)
NOT_IN_PLACE = register_reason(
    "not_in_place",
    "{object} does not stand on {place}: {distance} and {angle} off",
    distance=METRES,
    angle=RADIANS,
)
TILTED_OR_TURNED = register_reason(
    "tilted_or_turned",
    "{object} is tilted or turned on {place}: {distance} and {angle} off",
    distance=METRES,
    angle=RADIANS,
)


@register("goal relation", "on")
class On(GoalRelation):
    """See the file."""

    presence = Presence.BORNE

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        local, model = final.in_place(goal), final.model(goal.object)
        distance = float(np.linalg.norm(local[:3] - [0.0, 0.0, model.extent[2] / 2]))
        angle = lean(local[3:], model) if final.is_object(goal.place) else turn(local[3:], model)
        found = is_on(final.whereabouts, goal.object, goal.place)
        beside = final.is_object(goal.place) and float(found.aside[0]) > 0.0
        reason = STANDS
        if distance > goal.position_tolerance or beside:
            reason = NOT_IN_PLACE
        elif not bool(found.is_borne(final.is_object(goal.place))[0]):
            said = ON_SOMETHING_ELSE(object=goal.object, place=goal.place)
            return Placement(False, said, distance, angle)
        elif angle > goal.angle_tolerance:
            reason = TILTED_OR_TURNED
        outcome = reason(object=goal.object, place=goal.place, distance=distance, angle=angle)
        return Placement(reason is STANDS, outcome, distance, angle)
