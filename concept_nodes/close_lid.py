"""CloseLid: turn a lid shut by what the hand holds of it."""

from __future__ import annotations

from bt_tasksim.concept.parameters import MetresPerSecond, Newtons, ObjectName
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept_nodes.close_door import CloseDoor
from bt_tasksim.concept_nodes.limits import PART_FORCE_LIMIT
from bt_tasksim.core.registry import register


@register("concept")
class CloseLid(CloseDoor):
    """Turn a lid down, onto its stop, by the handle in the hand (PR to OP): a door about a level axis.

    The hand holds it all the way, so that it does not fall.

    Args:
        target: The lid.
        speed: Peak speed of the tool.
        press: Force against the motion by which a stop is felt.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    speed: MetresPerSecond = 0.15
    press: Newtons = 12.0
    force_limit: Newtons = PART_FORCE_LIMIT

    presentation = Presentation(
        colour="#3f6f2f",
        spoken=r"(?:clos|shut|lower).*(?:lid|cover)",
        sayings=("I close the {}", "lower the {}", "now put the {} down"),
    )
