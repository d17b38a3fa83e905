"""Goal relations: what a `Goal` may ask of an object at the end of a run, one file each."""

from __future__ import annotations

from bt_tasksim.core.registry import part
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement

__all__ = ["FinalState", "GoalRelation", "Placement", "relation_named"]


def relation_named(name: str) -> GoalRelation:
    """The relation of a name.

    Raises:
        InputError: None is registered under it.
    """
    relation: type[GoalRelation] = part("goal relation", name)
    return relation()
