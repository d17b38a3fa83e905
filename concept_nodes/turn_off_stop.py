"""TurnOffStop: turn a lever off the stop that it leans on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.parameters import MetresPerSecond, Newtons, ObjectName, Radians
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept_nodes.joint_values import nearer_stop
from bt_tasksim.concept_nodes.limits import PART_FORCE_LIMIT
from bt_tasksim.concept_nodes.on_joint import OnJoint
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register


@register("concept")
class TurnOffStop(OnJoint):
    """Turn a lever, or anything that turns between stops, off the one that is nearer (OT to TR, rotation).

    Args:
        target: The lever.
        angle: How far it is from that stop in the end.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    angle: Radians
    speed: MetresPerSecond = 0.15
    force_limit: Newtons = PART_FORCE_LIMIT

    turns = True
    establishes = (ConditionOf("OffStop", target="target"),)
    requires = (ConditionOf("Turns", target="target"),)
    contact = ContactChange(ContactState.OT, ContactState.TR, "rotation")
    presentation = Presentation(
        colour="#b08fbf",
        spoken=r"(?:turn|take).*off .*stop|(?:loosen|release).*lever",
        sayings=("I turn the {} off its stop", "take the {} off the stop", "pull the {} back a bit"),
    )

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """How far."""
        return f"by {float(parameters['angle']):.2f} rad" if "angle" in parameters else ""

    def wanted(self, now: Array, limits: Array) -> Array:
        """See `OnJoint.wanted`."""
        stop, way = nearer_stop(now, limits)
        return stop - way * self.angle
