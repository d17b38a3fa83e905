"""Turned, oriented, pointing up: the object hangs in the hand alone, and how it is turned there.

Turned is by ``value`` about ``axis`` (robot base frame) from how it was drawn; oriented, as a place or
another object is, turned by ``value`` about ``axis`` of that one; both up to the object's symmetry. Of what
points up the object's own ``axis`` is upright, whatever its heading.
"""

from __future__ import annotations

import math

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import RADIANS
from bt_tasksim.scene.fixtures import FixturePart
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement, turn
from bt_tasksim.scene.specs import Goal

IS_TURNED = register_reason(
    "is_turned", "{object} is held as it should be turned, {angle} off", angle=RADIANS
)
TURNED_OTHERWISE = register_reason(
    "turned_otherwise", "{object} is not turned as it should be: {angle} off", angle=RADIANS
)
NOT_HELD_FREE = register_reason("not_held_free", "{object} does not hang in the hand alone")
UP = (0.0, 0.0, 1.0)


class _Turned(GoalRelation):
    """A relation about how something is turned in the hand."""

    in_hand = True
    needs_place = False

    def off(self, goal: Goal, final: FinalState) -> float:
        """Radians from how it should be turned."""
        raise NotImplementedError

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        angle = self.off(goal, final)
        if final.borne(goal.object) or not final.touched(goal.object):
            return Placement(False, NOT_HELD_FREE(object=goal.object), math.nan, angle)
        reached = angle <= goal.angle_tolerance
        outcome = (IS_TURNED if reached else TURNED_OTHERWISE)(object=goal.object, angle=angle)
        return Placement(reached, outcome, math.nan, angle)


@register("goal relation", "turned")
class Turned(_Turned):
    """See the file."""

    def fault(self, goal: Goal, part: FixturePart | None) -> str:
        """See `GoalRelation.fault`."""
        said = f"the goal 'turned' of '{goal.object}' needs a 'value', by how many radians"
        return said if goal.value is None else ""

    def off(self, goal: Goal, final: FinalState) -> float:
        """See `_Turned.off`."""
        should = poses.quat_multiply(_turn(goal), final.start(goal.object)[3:])
        return _between(should, goal, final)


@register("goal relation", "oriented")
class Oriented(_Turned):
    """See the file."""

    needs_place = True

    def off(self, goal: Goal, final: FinalState) -> float:
        """See `_Turned.off`."""
        there = final.is_object(goal.place)
        frame = final.pose(goal.place) if there else np.asarray(final.place(goal.place).pose)
        return _between(poses.quat_multiply(frame[3:], _turn(goal)), goal, final)


@register("goal relation", "pointing_up")
class PointingUp(_Turned):
    """See the file."""

    def off(self, goal: Goal, final: FinalState) -> float:
        """See `_Turned.off`."""
        up = poses.rotate(final.pose(goal.object)[3:], poses.unit(np.array(goal.axis or UP)))
        return math.acos(min(1.0, max(-1.0, float(up[2]))))


def _turn(goal: Goal) -> Array:
    """The rotation ``(4,)`` that a goal says."""
    return poses.from_rotation_vector((goal.value or 0.0) * poses.unit(np.array(goal.axis or UP)))


def _between(should: Array, goal: Goal, final: FinalState) -> float:
    """Radians of a goal's object from a rotation ``(4,)``, up to its symmetry."""
    now = final.pose(goal.object)[3:]
    return turn(poses.quat_multiply(poses.quat_conjugate(should), now), final.model(goal.object))
