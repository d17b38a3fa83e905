"""Reactive fallback: conditions are asked again at every tick."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from py_trees.behaviour import Behaviour
from py_trees.composites import Selector

from bt_tasksim.core.registry import register
from bt_tasksim.trees.nodes.base import NodeKind, free_children
from bt_tasksim.trees.nodes.batch import NodePlace
from bt_tasksim.trees.nodes.fallback import BatchSelector


def reactive_fallback(name: str, *children: Behaviour) -> Selector:
    """A fallback that asks its conditions again at every tick; only its last child may act.

    Raises:
        InputError: A child is not a behaviour, or already has a parent.
    """
    return Selector(name, memory=False, children=free_children(name, children))


@register("tree node", "ReactiveFallback")
class ReactiveFallbackKind(NodeKind[Selector]):
    """py_trees' selector without memory."""

    category = "Control"
    behaviour = Selector
    symbol = "?ᴿ"
    label = "reactive fallback"
    helper = staticmethod(reactive_fallback)

    def describes(self, node: Behaviour) -> bool:
        """See `NodeKind.describes`."""
        return type(node) is Selector and not node.memory

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> Selector:
        """See `NodeKind.make`."""
        return reactive_fallback(name, *children)

    def ticked_again(self, node: Selector) -> Iterable[Behaviour]:
        """All but the last: only the last child may act."""
        return node.children[:-1]

    def compiled(self, node: Selector, place: NodePlace) -> BatchSelector:
        """See `NodeKind.compiled`."""
        return BatchSelector(place, memory=False)
