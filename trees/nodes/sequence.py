"""Sequence: one child after the other."""

from __future__ import annotations

from collections.abc import Mapping

from py_trees.behaviour import Behaviour
from py_trees.composites import Sequence

from bt_tasksim.core.registry import register
from bt_tasksim.trees.nodes.base import NodeKind, free_children


def sequence(name: str, *children: Behaviour) -> Sequence:
    """One child after the other; goes on where it stood; fails with the first child that fails.

    Raises:
        InputError: A child is not a behaviour, or already has a parent.
    """
    return Sequence(name, memory=True, children=free_children(name, children))


@register("tree node", "Sequence")
class SequenceKind(NodeKind[Sequence]):
    """py_trees' sequence with memory."""

    category = "Control"
    behaviour = Sequence
    symbol = "→"
    label = "sequence"
    helper = staticmethod(sequence)

    def describes(self, node: Behaviour) -> bool:
        """See `NodeKind.describes`."""
        return type(node) is Sequence and node.memory

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> Sequence:
        """See `NodeKind.make`."""
        return sequence(name, *children)
