"""TurnToStop: turn a lever onto its stop."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.parameters import Flag, MetresPerSecond, Newtons, ObjectName
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept_nodes.limits import PART_FORCE_LIMIT
from bt_tasksim.concept_nodes.to_stop import ToStop
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register


@register("concept")
class TurnToStop(ToStop):
    """Turn a lever, or whatever turns between stops, until the wrist feels its stop (TR to OT, rotation).

    Args:
        target: The lever.
        back: Onto the stop where its value is least, and not onto the one where it is largest.
        speed: Peak speed of the tool.
        press: Force against the motion by which the stop is felt.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    back: Flag = False
    speed: MetresPerSecond = 0.15
    press: Newtons = 12.0
    force_limit: Newtons = PART_FORCE_LIMIT

    turns = True
    establishes = (
        ConditionOf("IsOpen", target="target", given={"back": False}, sometimes=True),
        ConditionOf("IsShut", target="target", given={"back": True}, sometimes=True),
    )
    requires = (ConditionOf("Turns", target="target"),)
    contact = ContactChange(ContactState.TR, ContactState.OT, "rotation")
    presentation = Presentation(
        colour="#8f5f9f",
        spoken=r"(?:turn|push|throw).*(?:lever|stop)",
        sayings=("I throw the {}", "turn the {} to its stop", "push the {} all the way"),
    )

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Which way, where it is back."""
        return "back" if parameters.get("back") else ""

    @property
    def stops(self) -> int:
        """See `OnJoint.stops`."""
        return -1 if self.back else 1

    def wanted(self, now: Array, limits: Array) -> Array:
        """See `OnJoint.wanted`."""
        return limits[:, 0 if self.back else 1] + 0.0 * now
