"""TipUp: tip a held thing that lies over one of its ends, until it stands on that."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.demonstrated import nearest_way
from bt_tasksim.concept.parameters import Direction, MetresPerSecond, Newtons, ObjectName
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT
from bt_tasksim.concept_nodes.tipping import Tipping, long_axis
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import ObjectModel


@register("concept")
class TipUp(Tipping):
    """Tip a held thing that lies up onto one of its ends (breaks its contact of rotation: PC to NC).

    It turns about the edge below that end, which stays on what it lies on and may slide a little, and is
    put down at last until the surface is felt. Its ends are those of its longest axis.

    Args:
        target: The held object.
        towards: To which side the end is on which it shall stand, robot base frame; by default either.
        press: Force that counts as that of the surface.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    towards: Direction | None = None
    press: Newtons = 3.0
    speed: MetresPerSecond = 0.15
    force_limit: Newtons = FORCE_LIMIT

    establishes = (ConditionOf("OnEnd", target="target"),)
    contact = ContactChange(ContactState.PC, ContactState.NC, motion="rotation")
    presentation = Presentation(
        colour="#5b8c2a",
        spoken=r"tip(?:ping)? .* up|stand .* up|set .* upright|upend",
        sayings=("I tip the {} up", "stand the {} up on its end"),
    )
    words = "be tipped up onto an end"

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Over which side."""
        return f"over its end {nearest_way(parameters['towards'])}" if parameters.get("towards") else ""

    @classmethod
    def sides(cls, model: ObjectModel) -> list[Array]:
        """Both ends."""
        axis = long_axis(model)
        return [] if axis is None else [sign * np.eye(3)[axis] for sign in (1.0, -1.0)]
