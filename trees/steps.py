"""Which stages of a sequence have to follow each other, and which may change places."""

from __future__ import annotations

from collections.abc import Sequence

from bt_tasksim.concept.leaf import ModelLeaf
from bt_tasksim.trees.stages import Stage, acting, is_in_hand
from bt_tasksim.trees.walk import preorder

Step = list[list[Stage]]
"""Blocks of stages that may change places; the stages of a block keep their order."""


def in_steps(row: Sequence[Stage]) -> list[Step]:
    """Stages in a row as steps that follow each other.

    Two stages keep their order where one of them acts on an object that the other names: what stands on it,
    or beside it, comes after it. What takes nothing, and what has something in the hand at its end, is a step
    of its own: nothing goes past it.

    Args:
        row: The stages, in order.
    """
    steps: list[Step] = []
    open_to_more = False
    for stage in row:
        moves = bool(stage.guards) and not any(map(is_in_hand, stage.guards))
        if not (moves and open_to_more):
            steps.append([[stage]])
        else:
            step = steps[-1]
            tied = [k for k, block in enumerate(step) if any(are_tied(stage, other) for other in block)]
            first = tied[0] if tied else len(step)
            step[first:] = [[*(other for block in step[first:] for other in block), stage]]
        open_to_more = moves
    return steps


def are_tied(first: Stage, second: Stage) -> bool:
    """One of two stages acts on an object that the other one names."""
    return bool(_actors(first) & _names(second) or _actors(second) & _names(first))


def _actors(stage: Stage) -> set[str]:
    """The objects that a stage acts on."""
    return {leaf.model.actor for node in stage.nodes for leaf in acting(node) if leaf.model.actor}


def _names(stage: Stage) -> set[str]:
    """The objects and places that a stage names."""
    return {
        str(leaf.model.values[name])
        for node in stage.nodes
        for _, leaf in preorder(node)
        if isinstance(leaf, ModelLeaf)
        for name, parameter in type(leaf.model).parameters().items()
        if parameter.quantity.kind in ("object", "place")
    }
