"""Whether leaves ask for values that a part's joint can have: tasks, and conditions that ask about it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept_nodes.joint_conditions import SLACK, IsOpen
from bt_tasksim.concept_nodes.on_joint import OnJoint
from bt_tasksim.core.joints import JointModel
from bt_tasksim.core.units import METRES, RADIANS, degrees_meant

OPENING = IsOpen.parameters()["by"].quantity
"""The quantity of a parameter that is a value of a joint."""


def asks_for_a_value(model: Any) -> bool:
    """It is a condition that compares a part's joint with a value."""
    return isinstance(model, Condition) and hasattr(model, "target") and any(_values(model))


def beyond(model: Any, joint: JointModel) -> str:
    """What is wrong with what a task or a condition asks of a part with such a joint; empty for nothing."""
    if isinstance(model, OnJoint):
        why = model.beyond_its_way(joint)
        return why and why + _in_radians(model)
    unit, slack = (RADIANS, SLACK[1]) if joint.turns else (METRES, SLACK[0])
    low, high = joint.limits
    for value in _values(model):
        if not low - slack <= value <= high + slack:
            meant = degrees_meant(value) if joint.turns else ""
            return (
                f"{model.target} is asked about at {unit.text(value)}, and it goes from {unit.text(low)} to "
                f"{unit.text(high)} only{meant}"
            )
    return ""


def _values(condition: Condition) -> Iterator[float]:
    """The values of joints that a condition names, metres or radians."""
    for name, parameter in condition.parameters().items():
        value = condition.values[name]
        if parameter.quantity == OPENING and value is not None:
            yield value


def _in_radians(model: OnJoint) -> str:
    """What to say of a task's angles where one looks like degrees."""
    angles = (
        model.values[name]
        for name, parameter in model.parameters().items()
        if parameter.quantity.unit == "rad"
    )
    return next((meant for value in angles if value is not None and (meant := degrees_meant(value))), "")
