"""Fallback: one child after the other until one succeeds."""

from __future__ import annotations

from collections.abc import Mapping

from py_trees.behaviour import Behaviour
from py_trees.composites import Selector

from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.trees.nodes.base import NodeKind, free_children
from bt_tasksim.trees.nodes.batch import FAILURE, INVALID, RUNNING, SUCCESS, BatchNode, NodePlace


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

    def compiled(self, node: Selector, place: NodePlace) -> BatchSelector:
        """See `NodeKind.compiled`."""
        return BatchSelector(place, memory=True)


class BatchSelector(BatchNode):
    """py_trees' selector in many worlds at once.

    Args:
        place: Where it stands.
        memory: Whether it goes on where it stood.
    """

    def __init__(self, place: NodePlace, memory: bool) -> None:
        super().__init__(place)
        self.memory, self.last = memory, len(place.children) - 1
        self.stands_at = self.arrays.indices(len(place.children))
        """``(N,)`` the child that did not fail in the last tick."""

    def tick(self, rows: Array) -> None:
        """On to the first child, or to where it stood."""
        self.stands_at[self.begins(rows)] = 0
        if not self.memory:
            self.tick_child(0, rows)
            return
        for child, there in self.arrays.groups(self.stands_at[rows], rows):
            self.stop_children(there, range(child))
            self.tick_child(child, there)

    def after(self, child: int, rows: Array, status: Array) -> None:
        """Back, or on to the next child."""
        found = (status == SUCCESS) | (status == RUNNING)
        (over, said), (on, _) = self.split(found, rows, status)
        changed = self.part(over, self.stands_at[over] != child)
        self.stop_children(changed, range(child + 1, self.last + 1))
        self.stands_at[changed] = child
        self.end(over, said)
        if child == self.last:
            self.stands_at[on] = child
            self.end(on, FAILURE)
            return
        self.tick_child(child + 1, on)

    def current(self, row: int) -> int | None:
        """The child that did not fail in the last tick, or the last one."""
        return int(self.stands_at[row]) if int(self.place.status[row]) != INVALID else None
