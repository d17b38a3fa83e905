"""CloseDrawer: push a drawer shut by the handle that the hand holds."""

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
class CloseDrawer(ToStop):
    """Push a drawer, or anything that slides, onto its stop by the handle in the hand (PR to OP).

    Args:
        target: The drawer.
        speed: Peak speed of the tool.
        press: Force against the motion by which a stop is felt.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    speed: MetresPerSecond = 0.15
    press: Newtons = 12.0
    force_limit: Newtons = PART_FORCE_LIMIT

    establishes = (ConditionOf("IsShut", target="target"),)
    requires = (ConditionOf("Slides", target="target"),)
    contact = ContactChange(ContactState.PR, ContactState.OP)
    presentation = Presentation(
        colour="#8a5a1e",
        spoken=r"clos.*drawer|shut.*drawer|push .* (?:in|shut)\b",
        sayings=("I close the {}", "push the {} shut", "now shut the {}"),
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
