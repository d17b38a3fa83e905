"""Whether a leaf that moves a part of furniture is one for what slides or turns as that part does."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept_nodes.handle import NO_PART, OTHER_PART
from bt_tasksim.concept_nodes.joint_conditions import Slides, Turns
from bt_tasksim.concept_nodes.on_joint import OnJoint
from bt_tasksim.concept_nodes.press_button import PressButton
from bt_tasksim.core.joints import JointModel
from bt_tasksim.core.registry import parts

Mover = OnJoint | PressButton
"""A task of a part of furniture."""


def turns(model: Mover) -> bool:
    """It moves what turns, and not what slides."""
    return isinstance(model, OnJoint) and model.turns


def of_other_kind(model: Mover, joint: JointModel | None) -> str:
    """What is wrong with a task of a part with such a joint, or of what has none; empty for nothing."""
    if joint is None:
        return NO_PART(object=model.target).sentence
    return "" if joint.turns == turns(model) else OTHER_PART[turns(model)](object=model.target).sentence


def what_to_do(model: Mover, joint: JointModel | None) -> str:
    """What to do about a task of the other kind: the one that does the same with such a part, if any."""
    if joint is not None and (name := fitting(type(model))):
        return f"use {name}, which moves what {'turns' if joint.turns else 'slides'}"
    return "name a part that it moves, or take this leaf away"


def fitting(concept: type[Mover]) -> str:
    """Name of the concept that brings about the same with parts of the other kind; empty where none does."""
    if not issubclass(concept, OnJoint):
        return ""
    found = [
        kind
        for kind in parts("concept").values()
        if issubclass(kind, OnJoint) and kind.turns != concept.turns and _aims(kind) == _aims(concept)
    ]
    return min(found, key=lambda kind: (len(kind.__mro__), kind.__name__)).__name__ if found else ""


def is_asked(model: Any, conditions: Iterable[object]) -> bool:
    """A tree asks how a leaf's part moves, so that it is its own affair what it does about it."""
    return any(isinstance(one, Slides | Turns) and one.target == model.target for one in conditions)


def _aims(concept: type[ConceptModel]) -> set[str]:
    return {condition.condition for condition in concept.establishes}
