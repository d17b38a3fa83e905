"""Reactive sequence: conditions are asked again at every tick."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from py_trees.behaviour import Behaviour
from py_trees.composites import Sequence

from bt_tasksim.core.registry import register
from bt_tasksim.trees.nodes.base import NodeKind, free_children
from bt_tasksim.trees.nodes.batch import NodePlace
from bt_tasksim.trees.nodes.sequence import BatchSequence


def reactive_sequence(name: str, *children: Behaviour) -> Sequence:
    """A sequence that asks its conditions again at every tick; only its last child may act.

    Raises:
        InputError: A child is not a behaviour, or already has a parent.
    """
    return Sequence(name, memory=False, children=free_children(name, children))


@register("tree node", "ReactiveSequence")
class ReactiveSequenceKind(NodeKind[Sequence]):
    """py_trees' sequence without memory."""

    category = "Control"
    behaviour = Sequence
    symbol = "→ᴿ"
    label = "reactive sequence"
    helper = staticmethod(reactive_sequence)

    def describes(self, node: Behaviour) -> bool:
        """See `NodeKind.describes`."""
        return type(node) is Sequence and not node.memory

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> Sequence:
        """See `NodeKind.make`."""
        return reactive_sequence(name, *children)

    def ticked_again(self, node: Sequence) -> Iterable[Behaviour]:
        """All but the last: only the last child may act."""
        return node.children[:-1]

    def compiled(self, node: Sequence, place: NodePlace) -> BatchSequence:
        """See `NodeKind.compiled`."""
        return BatchSequence(place, memory=False)
