"""TurnKnob: turn a knob or a valve about its axis with the wrist."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.parameters import MetresPerSecond, Newtons, ObjectName, Radians
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept_nodes.limits import PART_FORCE_LIMIT
from bt_tasksim.concept_nodes.on_joint import OnJoint
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register


@register("concept")
class TurnKnob(OnJoint):
    """Turn a knob, a valve or a lever that the hand holds to where it should be (keeps PR, rotation).

    The grasp before it is chosen so that the wrist has the range for all of the turn. One that needs more is
    made of several: grasp, turn and release for each.

    Args:
        target: The knob.
        angle: How far it is turned in the end, from its value 0.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    angle: Radians
    speed: MetresPerSecond = 0.15
    force_limit: Newtons = PART_FORCE_LIMIT

    turns = True
    establishes = (ConditionOf("JointAt", target="target", at="angle"),)
    requires = (ConditionOf("Turns", target="target"),)
    contact = ContactChange(ContactState.PR, ContactState.PR, "rotation")
    presentation = Presentation(
        colour="#6f6fa8",
        spoken=r"turn.*(?:knob|valve)|(?:knob|valve).*turn",
        sayings=("I turn the {}", "turn the {} to the left", "now set the {}"),
    )

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """How far."""
        return f"to {float(parameters['angle']):.2f} rad" if "angle" in parameters else ""

    def wanted(self, now: Array, limits: Array) -> Array:
        """See `OnJoint.wanted`."""
        return self.angle + 0.0 * now
