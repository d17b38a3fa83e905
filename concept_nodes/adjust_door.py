"""AdjustDoor: turn a door that is half open to where it should be."""

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
class AdjustDoor(OnJoint):
    """Turn a half-open door, or anything on a hinge, by the handle in the hand (keeps PR).

    Args:
        target: The door.
        angle: How far it is open in the end, from its value 0.
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
        colour="#79a3b1",
        spoken=r"adjust.*door|(?:half|part).* open|a bit (?:farther|further)",
        sayings=("I adjust the {}", "swing the {} a bit", "leave the {} ajar"),
    )

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """How far."""
        return f"to {float(parameters['angle']):.2f} rad" if "angle" in parameters else ""

    def wanted(self, now: Array, limits: Array) -> Array:
        """See `OnJoint.wanted`."""
        return self.angle + 0.0 * now
