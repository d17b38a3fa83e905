"""On end, and lying: how the longest axis of what rests somewhere leans.

On end it is upright, lying it is level. With a place, or another object, the object rests on that.
"""

from __future__ import annotations

import math

import numpy as np

from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, RADIANS
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement
from bt_tasksim.scene.spatial_laws import is_on, rise_of_long_axis
from bt_tasksim.scene.specs import Goal

RESTS_SO = register_reason("rests_so", "{object} {how}, {angle} off", angle=RADIANS)
RESTS_OTHERWISE = register_reason(
    "rests_otherwise", "{object} should {how}: its longest axis is {angle} off", angle=RADIANS
)
BORNE_BY_NOTHING = register_reason("borne_by_nothing", "{object} rests on nothing")
RESTS_ELSEWHERE = register_reason(
    "rests_elsewhere",
    "{object} does not rest on {place}: {aside} beyond its edge, {height} above it",
    aside=METRES,
    height=METRES,
)


class _Resting(GoalRelation):
    """A relation about the longest axis."""

    needs_place = False
    rise = 0.0
    """Radians from level that the axis should have."""
    how = ("lies", "lie")

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        pose, model = final.pose(goal.object), final.model(goal.object)
        rise = float(rise_of_long_axis(pose[None, 3:], np.array([model.extent]))[0])
        angle = abs(self.rise - rise)
        if angle > goal.angle_tolerance:
            return Placement(
                False, RESTS_OTHERWISE(object=goal.object, how=self.how[1], angle=angle), math.nan, angle
            )
        if not final.borne(goal.object):
            return Placement(False, BORNE_BY_NOTHING(object=goal.object), math.nan, angle)
        if goal.place:
            found = is_on(final.whereabouts, goal.object, goal.place)
            aside, height = float(found.aside[0]), float(found.height[0])
            if aside > 0.0 or abs(height) > goal.position_tolerance or bool(found.elsewhere[0]):
                named = {"object": goal.object, "place": goal.place}
                said = RESTS_ELSEWHERE(**named, aside=aside, height=height)
                return Placement(False, said, max(aside, abs(height)), angle)
        return Placement(True, RESTS_SO(object=goal.object, how=self.how[0], angle=angle), math.nan, angle)


@register("goal relation", "on_end")
class OnEnd(_Resting):
    """See the file."""

    rise = math.pi / 2
    how = ("stands on an end", "stand on an end")


@register("goal relation", "lying")
class Lying(_Resting):
    """See the file."""
