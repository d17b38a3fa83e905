"""Goals of parts of fixtures: ``open`` at least so far, ``shut``, or ``set`` to a value.

Such a part may be held at the end: who opens a door often keeps it in the hand.
"""

from __future__ import annotations

import abc
import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.joints import SLIDES, JointModel, Joints
from bt_tasksim.core.outcomes import Reason, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, RADIANS, Unit, degrees_meant
from bt_tasksim.scene.fixtures import FixturePart
from bt_tasksim.scene.joint_laws import ValueAsked, opened, set_to, shut
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement
from bt_tasksim.scene.specs import Goal


def _pair(name: str, sentence: str) -> dict[str, Reason]:
    """One reason for what slides and one for what turns, which have other units."""
    units: dict[str, Unit] = {"slide": METRES, "hinge": RADIANS}
    return {
        kind: register_reason(f"{name}_{kind}", sentence, value=unit, wanted=unit)
        for kind, unit in units.items()
    }


IS_OPEN = _pair("open", "{object} is open by {value}, at least {wanted} were asked for")
NOT_OPEN = _pair("not_open", "{object} is open by {value}, and not by {wanted}")
IS_SHUT = _pair("shut", "{object} is shut: open by {value}, and up to {wanted} count")
NOT_SHUT = _pair("not_shut", "{object} is not shut: open by {value}, and only up to {wanted} count")
IS_SET = _pair("set", "{object} stands at {value}, and should at {wanted}")
NOT_SET = _pair("not_set", "{object} stands at {value}, and not at {wanted}")


MAY_BE = 0.5
"""Share of its way by which a part that is drawn may go farther than the one in the middle of all draws."""


class JointGoal(GoalRelation):
    """A goal of a part of a fixture."""

    needs_place = False
    may_be_held = True
    position_tolerance = 0.01
    angle_tolerance = math.radians(5.0)

    def fault(self, goal: Goal, part: FixturePart | None) -> str:
        """See `GoalRelation.fault`: it is no part, or cannot come there."""
        if part is None:
            return (
                f"the goal '{goal.relation}' is one of parts of fixtures, such as a drawer, and "
                f"'{goal.object}' is a free object"
            )
        if goal.value is None:
            return ""
        (low, high), unit = part.limits, METRES if part.kind == SLIDES else RADIANS
        room = MAY_BE * (high - low)
        if low - room <= goal.value <= high + room:
            return ""
        meant = "" if part.kind == SLIDES else degrees_meant(goal.value)
        return (
            f"the goal '{goal.relation}' of '{goal.object}' asks for {unit.text(goal.value)}, and it goes "
            f"from {unit.text(low)} to {unit.text(high)}{meant}"
        )

    @staticmethod
    def joint(goal: Goal, final: FinalState) -> tuple[JointModel, Array]:
        """The part's joint, and how far ``(1,)`` it truly is open.

        Raises:
            InputError: The goal's object is none.
        """
        joint = final.model(goal.object).joint
        if joint is None:
            raise InputError(
                f"the goal '{goal.relation}' is one of parts of fixtures, such as a drawer, and "
                f"'{goal.object}' is a free object"
            )
        return joint, Joints.of([joint]).value(final.pose(goal.object)[None])

    @staticmethod
    def tolerance(goal: Goal, joint: JointModel) -> float:
        """What the goal allows, metres or radians."""
        return goal.angle_tolerance if joint.turns else goal.position_tolerance

    reasons: ClassVar[tuple[Mapping[str, Reason], ...]]
    """By kind of joint, where it is not so, and where it is."""

    @abc.abstractmethod
    def asked(self, goal: Goal, joint: JointModel, value: Array) -> ValueAsked:
        """What the goal asks for, and at which of some values ``(N,)`` of the joint it is so."""

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`; what is missing stands as an error of position or of angle."""
        joint, value = self.joint(goal, final)
        asked = self.asked(goal, joint, value)
        reached, off, nothing = bool(asked.so[0]), float(asked.off[0]), float(np.nan)
        reason = self.reasons[reached][joint.kind]
        outcome = reason(object=goal.object, value=float(value[0]), wanted=float(asked.wanted[0]))
        return Placement(reached, outcome, nothing if joint.turns else off, off if joint.turns else nothing)


@register("goal relation", "open")
class Open(JointGoal):
    """Open by ``value`` at least, up to the goal's tolerance; by default by most of its way."""

    reasons = (NOT_OPEN, IS_OPEN)

    def fault(self, goal: Goal, part: FixturePart | None) -> str:
        """See `GoalRelation.fault`: nor should its tolerance cover all that it asks for."""
        if (why := super().fault(goal, part)) or part is None or goal.value is None:
            return why
        slides, low = part.kind == SLIDES, part.limits[0]
        name, unit = ("position_tolerance", METRES) if slides else ("angle_tolerance", RADIANS)
        allowed = goal.position_tolerance if slides else goal.angle_tolerance
        if goal.value - low > allowed:
            return ""
        return (
            f"the goal 'open' of '{goal.object}' asks for {unit.text(goal.value)} and its {name} is "
            f"{unit.text(allowed)}, so it is reached with '{goal.object}' shut: give it a smaller tolerance, "
            "or a larger value"
        )

    def asked(self, goal: Goal, joint: JointModel, value: Array) -> ValueAsked:
        """See `JointGoal.asked`."""
        return opened(value, np.array([joint.limits]), goal.value, self.tolerance(goal, joint))


@register("goal relation", "shut")
class Shut(JointGoal):
    """Shut, up to some millimetres or degrees."""

    reasons = (NOT_SHUT, IS_SHUT)

    def asked(self, goal: Goal, joint: JointModel, value: Array) -> ValueAsked:
        """See `JointGoal.asked`."""
        return shut(value, np.array([joint.limits]), np.array([joint.turns]))


@register("goal relation", "set")
class SetTo(JointGoal):
    """Open by ``value``, up to the goal's tolerance."""

    reasons = (NOT_SET, IS_SET)

    def fault(self, goal: Goal, part: FixturePart | None) -> str:
        """See `GoalRelation.fault`."""
        if goal.value is None:
            return f"the goal 'set' of '{goal.object}' needs a 'value', how far it should be open"
        return super().fault(goal, part)

    def asked(self, goal: Goal, joint: JointModel, value: Array) -> ValueAsked:
        """See `JointGoal.asked`."""
        assert goal.value is not None, "see `fault`"
        return set_to(value, goal.value, self.tolerance(goal, joint))
