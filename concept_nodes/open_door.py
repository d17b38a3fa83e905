"""OpenDoor: turn a door open by the handle that the hand holds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.parameters import MetresPerSecond, Newtons, ObjectName, Radians
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept_nodes.joint_values import open_by
from bt_tasksim.concept_nodes.limits import PART_FORCE_LIMIT
from bt_tasksim.concept_nodes.on_joint import OnJoint
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register


@register("concept")
class OpenDoor(OnJoint):
    """Turn a door, or anything on a hinge, off its stop by the handle in the hand (OP to PR).

    Args:
        target: The door.
        angle: How far it is open in the end, from its value 0; by default all the way.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    angle: Radians | None = None
    speed: MetresPerSecond = 0.15
    force_limit: Newtons = PART_FORCE_LIMIT

    turns = True
    establishes = (
        ConditionOf("IsOpen", target="target", by="angle"),
        ConditionOf("IsOpen", target="target", given={"angle": None}),
    )
    requires = (ConditionOf("Turns", target="target"),)
    contact = ContactChange(ContactState.OP, ContactState.PR, "rotation")
    presentation = Presentation(
        colour="#4f7f8f",
        spoken=r"open.*door|swing .* open",
        sayings=("I open the {}", "swing the {} open", "turn the {} open"),
    )

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """How far."""
        return f"to {float(parameters['angle']):.2f} rad" if "angle" in parameters else ""

    @property
    def wholly(self) -> bool:
        """See `OnJoint.wholly`."""
        return self.angle is None

    def wanted(self, now: Array, limits: Array) -> Array:
        """See `OnJoint.wanted`: what is farther open stays so."""
        return open_by(self.angle, now, limits)
