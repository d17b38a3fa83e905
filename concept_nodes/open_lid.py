"""OpenLid: lift a lid by what the hand holds of it."""

from __future__ import annotations

from bt_tasksim.concept.parameters import MetresPerSecond, Newtons, ObjectName, Radians
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept_nodes.limits import PART_FORCE_LIMIT
from bt_tasksim.concept_nodes.open_door import OpenDoor
from bt_tasksim.core.registry import register


@register("concept")
class OpenLid(OpenDoor):
    """Turn a lid up, off its stop, by the handle in the hand (OP to PR): a door about a level axis.

    Args:
        target: The lid.
        angle: How far it is open in the end, from its value 0; by default all the way. What is open by
            less than upright falls shut when it is let go.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    angle: Radians | None = None
    speed: MetresPerSecond = 0.15
    force_limit: Newtons = PART_FORCE_LIMIT

    presentation = Presentation(
        colour="#5f8f4f",
        spoken=r"(?:open|lift|raise).*(?:lid|cover)",
        sayings=("I open the {}", "lift the {}", "now raise the {}"),
    )
