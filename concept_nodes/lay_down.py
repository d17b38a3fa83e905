"""LayDown: tip a held thing that stands on an end over, until it lies."""

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
from bt_tasksim.concept_nodes.tipping import Tipping, around, long_axis
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import ObjectModel


@register("concept")
class LayDown(Tipping):
    """Tip a held thing that stands on an end over, until it lies (makes contact of rotation: NC to PC).

    It turns about an edge of the end on which it stands, which stays there and may slide a little, and is put
    down at last until the surface is felt. What is round may fall any way, other things over their faces.

    Args:
        target: The held object.
        towards: To which side its upper end falls, robot base frame; by default any.
        press: Force that counts as that of the surface.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    towards: Direction | None = None
    press: Newtons = 3.0
    speed: MetresPerSecond = 0.05
    force_limit: Newtons = FORCE_LIMIT

    establishes = (ConditionOf("Lying", target="target"),)
    contact = ContactChange(ContactState.NC, ContactState.PC, motion="rotation")
    presentation = Presentation(
        colour="#8c6d2a",
        spoken=r"lay(?:ing)? .* (?:down|flat|on its side)|tip(?:ping)? .* over",
        sayings=("I lay the {} down on its side", "tip the {} over"),
    )
    words = "be laid down"

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """To which side."""
        return f"towards {nearest_way(parameters['towards'])}" if parameters.get("towards") else ""

    @classmethod
    def sides(cls, model: ObjectModel) -> list[Array]:
        """Its sides: all around where it is round, else its four faces."""
        axis = long_axis(model)
        if axis is None:
            return []
        if model.symmetry == 0 and axis == 2:
            return around(axis)
        return [sign * np.eye(3)[k] for k in range(3) if k != axis for sign in (1.0, -1.0)]
