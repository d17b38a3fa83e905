"""Fallback: one child after the other until one succeeds."""

from __future__ import annotations

from collections.abc import Mapping

from py_trees.behaviour import Behaviour
from py_trees.composites import Selector

from bt_tasksim.core.registry import register
from bt_tasksim.trees.nodes.base import NodeKind, free_children


def fallback(name: str, *children: Behaviour) -> Selector:
    """One child after the other until one succeeds; goes on where it stood.

    Raises:
        InputError: A child is not a behaviour, or already has a parent.
    """
    return Selector(name, memory=True, children=free_children(name, children))


@register("tree node", "Fallback")
class FallbackKind(NodeKind[Selector]):
    """py_trees' selector with memory."""

    category = "Control"
    behaviour = Selector
    symbol = "?"
    label = "fallback"
    helper = staticmethod(fallback)

    def describes(self, node: Behaviour) -> bool:
        """See `NodeKind.describes`."""
        return type(node) is Selector and node.memory

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> Selector:
        """See `NodeKind.make`."""
        return fallback(name, *children)
