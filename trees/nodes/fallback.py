"""Fallback: one child after the other until one succeeds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector

from bt_tasksim.concept.reporting import Reporting
from bt_tasksim.core.outcomes import Outcome, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.trees.nodes.base import NodeKind, free_children
from bt_tasksim.trees.nodes.batch import FAILURE, INVALID, RUNNING, SUCCESS, BatchNode, NodePlace
from bt_tasksim.trees.nodes.causes import Cause, batch_cause_of, cause_of, summary

ALTERNATIVES_FAILED = register_reason(
    "alternatives_failed", "no alternative succeeded (before the last one: {before})"
)


class Fallback(Reporting, Selector):
    """py_trees' selector with memory, which remembers why those failed that it tried before the last one.

    Args:
        name: The node's name.
        children: What is tried, one after the other.
    """

    def __init__(self, name: str, children: list[Behaviour]) -> None:
        super().__init__(name, memory=True, children=children)
        self.causes: list[Cause | None] = []

    def tick(self) -> Iterator[Behaviour]:
        """One tick, see py_trees."""
        if self.status != Status.RUNNING:
            self.causes = []
        for node in super().tick():
            if node.parent is self and node.status not in (Status.SUCCESS, Status.RUNNING):
                self.causes.append(cause_of(node))
            yield node

    def seen_from_here(self, outcome: Outcome) -> Outcome:
        """The last alternative's failure, with the causes of those before it."""
        return alternatives_failed(self.causes, outcome) if self.status == Status.FAILURE else outcome


def alternatives_failed(causes: Sequence[Cause | None], outcome: Outcome) -> Outcome:
    """Why the last alternative failed, and why those before it did.

    Args:
        causes: Of all of them, the last one's too; None where nobody says it.
        outcome: How the last one ended.
    """
    before = [cause for cause in causes[:-1] if cause is not None]
    return ALTERNATIVES_FAILED(outcome, before=summary(before)) if before else outcome


def fallback(name: str, *children: Behaviour) -> Fallback:
    """One child after the other until one succeeds; goes on where it stood.

    Raises:
        InputError: A child is not a behaviour, or already has a parent.
    """
    return Fallback(name, free_children(name, children))


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
        return type(node) is Fallback or (type(node) is Selector and node.memory)

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> Fallback:
        """See `NodeKind.make`."""
        return fallback(name, *children)

    def compiled(self, node: Selector, place: NodePlace) -> BatchSelector:
        """See `NodeKind.compiled`."""
        return BatchFallback(place, memory=True) if type(node) is Fallback else BatchSelector(place, True)


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
        self.failed(child, on)
        if child == self.last:
            self.stands_at[on] = child
            self.end(on, FAILURE)
            return
        self.tick_child(child + 1, on)

    def failed(self, child: int, rows: Array) -> None:  # a plain selector forgets it
        """A child has failed in worlds."""

    def current(self, row: int) -> int | None:
        """The child that did not fail in the last tick, or the last one."""
        return int(self.stands_at[row]) if int(self.place.status[row]) != INVALID else None


class BatchFallback(BatchSelector):
    """`Fallback` in many worlds at once; why children failed is kept world by world."""

    def __init__(self, place: NodePlace, memory: bool) -> None:
        super().__init__(place, memory)
        self._causes: dict[int, list[Cause | None]] = {}

    def tick(self, rows: Array) -> None:
        """On to the first child, or to where it stood."""
        if self._causes:
            for row in self.begins(rows).tolist():
                self._causes.pop(row, None)
        super().tick(rows)

    def failed(self, child: int, rows: Array) -> None:
        """Remember why it did."""
        for row in rows.tolist():
            cause = batch_cause_of(self.batch.reasons, self.place.children[child], row)
            self._causes.setdefault(row, []).append(cause)

    def adds(self, row: int, outcome: Outcome) -> Outcome:
        """The last alternative's failure, with the causes of those before it."""
        if int(self.place.status[row]) != FAILURE:
            return outcome
        return alternatives_failed(self._causes.get(row, ()), outcome)
