"""The control nodes and decorators that trees are made of, by their names in BehaviorTree.CPP v4."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from py_trees.behaviour import Behaviour

from bt_tasksim.core.errors import nearest
from bt_tasksim.core.registry import parts
from bt_tasksim.trees.nodes.base import NodeKind

CATEGORIES = ("Action", "Condition", "Control", "Decorator", "SubTree")
"""Tags of the explicit form, in which the node's own name stands in the attribute ``ID``."""

OUTSIDE = frozenset((
    "AlwaysFailure", "AlwaysSuccess", "AsyncFallback", "AsyncSequence", "Delay", "IfThenElse",
    "KeepRunningUntilFailure", "LoopBool", "LoopDouble", "LoopInt", "LoopString", "ManualSelector",
    "ParallelAll", "Precondition", "RunOnce", "Script", "ScriptCondition", "SequenceStar",
    "SequenceWithMemory", "SetBlackboard", "SkipUnlessUpdated", "Sleep", "SubTreePlus", "Switch2",
    "Switch3", "Switch4", "Switch5", "Switch6", "TryCatch", "UnsetBlackboard", "WaitValueUpdate",
    "WasEntryUpdated", "WhileDoElse",
))  # fmt: skip
"""Nodes of BehaviorTree.CPP that are outside the subset."""


def node_kinds() -> dict[str, NodeKind[Any]]:
    """The kinds of control nodes and decorators, by their names in XML."""
    return {tag: kind(tag) for tag, kind in parts("tree node").items()}


def helpers() -> dict[str, Callable[..., Behaviour]]:
    """The functions that make such nodes in a tree's file, by their names."""
    found = (kind.helper for kind in node_kinds().values())
    return {helper.__name__: helper for helper in found if helper is not None}


def like_helper(name: str) -> str:
    """Says which of these functions may be meant by a name: that of a node in XML, or of its class.

    Returns:
        The end of a sentence, see `bt_tasksim.core.errors.nearest`.
    """
    plain = name.replace("_", "").casefold()
    for tag, kind in node_kinds().items():
        if kind.helper is not None and plain in (tag.casefold(), kind.behaviour.__name__.casefold()):
            return f"; did you mean '{kind.helper.__name__}'?"
    return nearest(name, helpers())


def kind_of(node: Behaviour) -> NodeKind[Any] | None:
    """The kind of a control node or decorator; None where it has no counterpart."""
    return next((kind for kind in node_kinds().values() if kind.describes(node)), None)
