"""When two trees are the same."""

from __future__ import annotations

from typing import Any

from py_trees.behaviour import Behaviour

from bt_tasksim.concept.leaf import ConceptNode, ModelLeaf
from bt_tasksim.trees.vocabulary import kind_of


def same_tree(a: Behaviour, b: Behaviour) -> bool:
    """Two trees have the same nodes in the same places: types, names, arguments, children.

    Arguments are compared by value, and an argument that is left out equals its default. A node that is
    neither a concept, a condition nor in the XML subset counts as the same by type, name and children alone.

    Args:
        a: The root of one tree.
        b: The root of the other.
    """
    stack = [(a, b)]
    while stack:
        left, right = stack.pop()
        if (
            _type(left) is not _type(right)
            or left.name != right.name
            or _arguments(left) != _arguments(right)
        ):
            return False
        if len(left.children) != len(right.children):
            return False
        stack.extend(zip(left.children, right.children, strict=True))
    return True


def _type(node: Behaviour) -> type:
    """What a node is: py_trees' own class, or ours that stands for it, are one kind."""
    kind = kind_of(node)
    return type(node) if kind is None else type(kind)


def _arguments(node: Behaviour) -> dict[str, Any]:
    kind = kind_of(node)
    if kind is not None:
        return {"tag": kind.tag, **kind.read(node)}
    if isinstance(node, ConceptNode):
        model, settings = node.model, ("timeout", "tolerance", "uncertainty")
        return {**model.values, "policy": node.policy, **{name: getattr(model, name) for name in settings}}
    return dict(node.model.values) if isinstance(node, ModelLeaf) else {}
