"""OpenDrawer: pull a drawer out by the handle that the hand holds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.parameters import Metres, MetresPerSecond, Newtons, ObjectName
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept_nodes.joint_values import open_by
from bt_tasksim.concept_nodes.limits import PART_FORCE_LIMIT
from bt_tasksim.concept_nodes.on_joint import OnJoint
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register


@register("concept")
class OpenDrawer(OnJoint):
    """Pull a drawer, or anything that slides, out of its stop by the handle in the hand (OP to PR).

    Args:
        target: The drawer.
        distance: How far it is open in the end, from its value 0; by default all the way.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    distance: Metres | None = None
    speed: MetresPerSecond = 0.15
    force_limit: Newtons = PART_FORCE_LIMIT

    establishes = (
        ConditionOf("IsOpen", target="target", by="distance"),
        ConditionOf("IsOpen", target="target", given={"distance": None}),
    )
    requires = (ConditionOf("Slides", target="target"),)
    contact = ContactChange(ContactState.OP, ContactState.PR)
    presentation = Presentation(
        colour="#b0792c",
        spoken=r"open.*drawer|pull .* out\b|slide .* open",
        sayings=("I open the {}", "pull the {} open", "now open the {}"),
    )

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """How far."""
        return f"to {float(parameters['distance']):.2f} m" if "distance" in parameters else ""

    @property
    def wholly(self) -> bool:
        """See `OnJoint.wholly`."""
        return self.distance is None

    def wanted(self, now: Array, limits: Array) -> Array:
        """See `OnJoint.wanted`: what is farther open stays so."""
        return open_by(self.distance, now, limits)
