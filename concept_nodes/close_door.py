"""CloseDoor: turn a door shut by the handle that the hand holds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.parameters import MetresPerSecond, Newtons, ObjectName
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept_nodes.limits import PART_FORCE_LIMIT
from bt_tasksim.concept_nodes.to_stop import ToStop
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register


@register("concept")
class CloseDoor(ToStop):
    """Turn a door, or anything on a hinge, onto its stop by the handle in the hand (PR to OP).

    Args:
        target: The door.
        speed: Peak speed of the tool.
        press: Force against the motion by which a stop is felt.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    speed: MetresPerSecond = 0.15
    press: Newtons = 12.0
    force_limit: Newtons = PART_FORCE_LIMIT

    turns = True
    establishes = (ConditionOf("IsShut", target="target"),)
    requires = (ConditionOf("Turns", target="target"),)
    contact = ContactChange(ContactState.PR, ContactState.OP, "rotation")
    presentation = Presentation(
        colour="#2f5f6f",
        spoken=r"clos.*door|shut.*door|swing .* shut",
        sayings=("I close the {}", "swing the {} shut", "now shut the {}"),
    )

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Nothing: it goes onto its stop."""
        return ""

    @property
    def stops(self) -> int:
        """See `OnJoint.stops`."""
        return -1

    def wanted(self, now: Array, limits: Array) -> Array:
        """See `OnJoint.wanted`."""
        return limits[:, 0] + 0.0 * now
