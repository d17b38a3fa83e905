"""Lifted: the object hangs in the hand alone, as high as it should, and as upright as it stood.

What stands on it, or lies in it, may come along.
"""

from __future__ import annotations

from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, RADIANS, Unit
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement
from bt_tasksim.scene.specs import Goal


class _Below(Unit):
    """A height that is missing; of one that is too much, the sentence says so."""

    def text(self, value: float, spec: str = "") -> str:
        return f"{super().text(abs(value), spec)} {'above' if value < 0.0 else 'below'}"


_OFF = {"missing": _Below(METRES.symbol, METRES.shown, METRES.scale), "angle": RADIANS}
HELD_UP = register_reason("held_up", "{object} is held up, {missing} and {angle} off", **_OFF)
NOT_LIFTED = register_reason("not_lifted", "{object} is not in the hand: {missing} and {angle} off", **_OFF)
SLIPPED = register_reason("slipped", "{object} did not follow the hand: {missing} and {angle} off", **_OFF)
TILTED = register_reason("tilted", "{object} did not keep upright: {missing} and {angle} off", **_OFF)


@register("goal relation", "lifted")
class Lifted(GoalRelation):
    """See the file."""

    in_hand = True
    needs_place = False

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        start, now = final.start(goal.object), final.pose(goal.object)
        missing = goal.height - float(now[2] - start[2])
        angle = float(poses.tilt(now[3:], start[3:]))
        reason = HELD_UP
        if final.borne(goal.object) or not final.touched(goal.object):
            reason = NOT_LIFTED
        elif abs(missing) > goal.position_tolerance:
            reason = SLIPPED
        elif angle > goal.angle_tolerance:
            reason = TILTED
        outcome = reason(object=goal.object, missing=missing, angle=angle)
        return Placement(reason is HELD_UP, outcome, abs(missing), angle)
