"""AdjustDrawer: pull or push a drawer that is half open to where it should be."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.parameters import Metres, MetresPerSecond, Newtons, ObjectName
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept_nodes.limits import PART_FORCE_LIMIT
from bt_tasksim.concept_nodes.on_joint import OnJoint
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register


@register("concept")
class AdjustDrawer(OnJoint):
    """Pull or push a half-open drawer, or anything that slides, by the handle in the hand (keeps PR).

    Args:
        target: The drawer.
        distance: How far it is open in the end, from its value 0.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    distance: Metres
    speed: MetresPerSecond = 0.15
    force_limit: Newtons = PART_FORCE_LIMIT

    establishes = (ConditionOf("JointAt", target="target", at="distance"),)
    requires = (ConditionOf("Slides", target="target"),)
    contact = ContactChange(ContactState.PR, ContactState.PR)
    presentation = Presentation(
        colour="#c79a4e",
        spoken=r"adjust.*drawer|(?:half|part).* open|a bit (?:farther|further)",
        sayings=("I adjust the {}", "move the {} a bit", "half open the {}"),
    )

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """How far."""
        return f"to {float(parameters['distance']):.2f} m" if "distance" in parameters else ""

    def wanted(self, now: Array, limits: Array) -> Array:
        """See `OnJoint.wanted`."""
        return self.distance + 0.0 * now
