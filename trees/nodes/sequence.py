"""Sequence: one child after the other."""

from __future__ import annotations

from collections.abc import Mapping

from py_trees.behaviour import Behaviour
from py_trees.composites import Sequence

from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.trees.nodes.base import NodeKind, free_children
from bt_tasksim.trees.nodes.batch import INVALID, SUCCESS, BatchNode, NodePlace


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

    def compiled(self, node: Sequence, place: NodePlace) -> BatchSequence:
        """See `NodeKind.compiled`."""
        return BatchSequence(place, memory=True)


class BatchSequence(BatchNode):
    """py_trees' sequence in many worlds at once.

    Args:
        place: Where it stands.
        memory: Whether it goes on where it stood.
    """

    def __init__(self, place: NodePlace, memory: bool) -> None:
        super().__init__(place)
        self.memory, self.last = memory, len(place.children) - 1
        self.stands_at = self.arrays.indices(len(place.children))
        """``(N,)`` the child that was ticked last; only a sequence with memory keeps it."""

    def tick(self, rows: Array) -> None:
        """On to the first child, or to where it stood."""
        begins = self.begins(rows)
        if len(begins):
            self.stop_ended(begins)
            self.stands_at[begins] = 0
        if not self.memory:
            self.tick_child(0, rows)
            return
        for child, there in self.arrays.groups(self.stands_at[rows], rows):
            self.tick_child(child, there)

    def after(self, child: int, rows: Array, status: Array) -> None:
        """On to the next child, or back."""
        (on, _), (over, said) = self.split(status == SUCCESS, rows, status)
        if not self.memory:
            self.stop_children(over, range(child + 1, self.last + 1))
        self.end(over, said)
        if child == self.last:
            self.end(on, SUCCESS)
            return
        if self.memory:
            self.stands_at[on] = child + 1
        self.tick_child(child + 1, on)

    def current(self, row: int) -> int | None:
        """The last child that is active or has ended: those behind it are stopped, or not yet begun."""
        for child in range(self.last, -1, -1):
            if int(self.place.child_status[child][row]) != INVALID:
                return child
        return None
