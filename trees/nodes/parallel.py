"""Parallel: all children in every tick, until enough have succeeded or failed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from bt_tasksim.concept.reporting import Reporting, said_below
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import Statement, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import COUNT
from bt_tasksim.trees.nodes.base import NodeKind, Port, free_children
from bt_tasksim.trees.nodes.batch import FAILURE, INVALID, RUNNING, SUCCESS, BatchNode, NodePlace

CHILDREN_FAILED = register_reason(
    "children_failed",
    "{failed} of {children} failed, last '{last}'",
    failed=COUNT,
    children=COUNT,
)


class Parallel(Reporting, Composite):
    """Ticks all children in every tick; a child that has finished is not ticked again.

    It succeeds as soon as ``success_count`` children have succeeded, and fails as soon as ``failure_count``
    have failed or too few are left to succeed; children that still run then are stopped. Counts are judged
    after every child, so that later children may not be ticked any more.

    Args:
        name: The node's name.
        children: Its children.
        success_count: From 1 to the number of children; negative ones count from all: -1 is all.
        failure_count: Likewise.

    Raises:
        InputError: A count does not fit the number of children.
    """

    def __init__(
        self, name: str, children: Sequence[Behaviour], success_count: int = -1, failure_count: int = 1
    ) -> None:
        for what, count in (("success", success_count), ("failure", failure_count)):
            if isinstance(count, bool) or not isinstance(count, int):
                raise InputError(f"'{name}': the {what} count should be a whole number, found {count!r}")
            if not 1 <= abs(count) <= max(len(children), 1):
                raise InputError(
                    f"'{name}': the {what} count should lie between 1 and its {len(children)} children "
                    f"(or be negative, to count from all), found {count}"
                )
        super().__init__(name, list(children))
        self.success_count = success_count
        self.failure_count = failure_count
        self._finished: dict[int, Status] = {}

    def counts(self) -> tuple[int, int]:
        """How many successes it needs, and with how many failures it fails."""
        total = len(self.children)
        needed, allowed = (c if c > 0 else total + c + 1 for c in (self.success_count, self.failure_count))
        return needed, allowed

    def tick(self) -> Iterator[Behaviour]:
        """One tick."""
        if self.status != Status.RUNNING:
            self._finished.clear()
            for child in self.children:
                if child.status != Status.INVALID:
                    child.stop(Status.INVALID)
            self.report(None)
            self.initialise()
        total = len(self.children)
        needed, allowed = self.counts()
        for index, child in enumerate(self.children):
            if index not in self._finished:
                self.current_child = child
                yield from child.tick()
                if child.status != Status.RUNNING:
                    self._finished[index] = child.status
            outcomes = list(self._finished.values())
            failed = outcomes.count(Status.FAILURE)
            if outcomes.count(Status.SUCCESS) >= needed:
                self.stop(Status.SUCCESS)
                yield self
                return
            if failed >= allowed or total - failed < needed:
                self.report(
                    CHILDREN_FAILED(said_below(child), failed=failed, children=total, last=child.name)
                )
                self.stop(Status.FAILURE)
                yield self
                return
        self.status = Status.RUNNING
        yield self

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """Stop the children that still run."""
        for child in self.children:
            if child.status == Status.RUNNING:
                child.stop(Status.INVALID)
        super().stop(new_status)


def parallel(name: str, *children: Behaviour, success: int = -1, failure: int = 1) -> Parallel:
    """All children in every tick, until enough have succeeded or failed.

    Args:
        name: The node's name.
        children: Its children.
        success: How many have to succeed; negative counts from all: -1 is all, -2 all but one.
        failure: How many failures make it fail; negative counts likewise.

    Raises:
        InputError: A child is not a behaviour or already has a parent, or a count does not fit.
    """
    return Parallel(name, free_children(name, children), success_count=success, failure_count=failure)


@register("tree node", "Parallel")
class ParallelKind(NodeKind[Parallel]):
    """See `Parallel`."""

    category = "Control"
    behaviour = Parallel
    symbol = "⇉"
    label = "parallel"
    ports = (
        Port("success_count", -1, "how many have to succeed; negative counts from all"),
        Port("failure_count", 1, "how many failures make it fail; negative counts from all"),
    )
    helper = staticmethod(parallel)

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> Parallel:
        """See `NodeKind.make`."""
        return parallel(name, *children, success=ports["success_count"], failure=ports["failure_count"])

    def read(self, node: Parallel) -> dict[str, int]:
        """See `NodeKind.read`."""
        return {"success_count": node.success_count, "failure_count": node.failure_count}

    def describe(self, node: Parallel) -> str:
        """See `NodeKind.describe`."""
        total = len(node.children)
        text = f"{self.label}, {_of(node.success_count, total)} must succeed"
        if node.failure_count != 1:
            text += f", {_of(node.failure_count, total)} failed ends it"
        return text

    def compiled(self, node: Parallel, place: NodePlace) -> BatchParallel:
        """See `NodeKind.compiled`."""
        return BatchParallel(place, *node.counts())


class BatchParallel(BatchNode):
    """`Parallel` in many worlds at once.

    Args:
        place: Where it stands.
        needed: Successes with which it succeeds.
        allowed: Failures with which it fails.
    """

    def __init__(self, place: NodePlace, needed: int, allowed: int) -> None:
        super().__init__(place)
        self.needed, self.allowed, self.total = needed, allowed, len(place.children)
        self.finished = self.arrays.full(False, "bool", self.total)
        """``(children, N)``: not ticked again."""
        self.succeeded, self.failed = self.arrays.full(0, "int32"), self.arrays.full(0, "int32")
        """``(N,)`` how many children."""
        self.ticked_last = self.arrays.indices(self.total)
        """``(N,)`` the child that was ticked last."""

    def tick(self, rows: Array) -> None:
        """On to the first child that has not finished."""
        begins = self.begins(rows)
        if len(begins):
            self.stop_ended(begins)
            self.succeeded[begins] = 0
            self.failed[begins] = 0
            for finished in self.finished:
                finished[begins] = False
        self._next(0, rows)

    def after(self, child: int, rows: Array, status: Array) -> None:
        """Count, then back or on to the next child."""
        ended = status != RUNNING
        if self.arrays.count(ended):
            self.finished[child][rows] = ended
            succeeded = self.succeeded[rows] + (status == SUCCESS)
            failed = self.failed[rows] + (status == FAILURE)
            self.succeeded[rows], self.failed[rows] = succeeded, failed
            won = succeeded >= self.needed
            lost = ~won & ((failed >= self.allowed) | (self.total - failed < self.needed))
            (over, won), (rows, _) = self.split(won | lost, rows, won)
            for k, running in enumerate(self.place.child_status):
                self.stop_child(k, self.part(over, running[over] == RUNNING))
            (winners,), (losers,) = self.split(won, over)
            self.end(winners, SUCCESS)
            self.end(losers, FAILURE)
        self._next(child + 1, rows)

    def _next(self, child: int, rows: Array) -> None:
        while child < self.total and len(rows):
            (rows,), (on,) = self.split(self.finished[child][rows], rows)
            self.ticked_last[on] = child
            self.tick_child(child, on)
            child += 1
        self.end(rows, RUNNING)

    def current(self, row: int) -> int | None:
        """The child that was ticked last."""
        return int(self.ticked_last[row]) if int(self.place.status[row]) != INVALID else None

    def says(self, row: int) -> Statement | None:
        """How many children failed."""
        if int(self.place.status[row]) != FAILURE:
            return None
        last = self.place.children[int(self.ticked_last[row])]
        reasons, failed = self.batch.reasons, int(self.failed[row])
        return CHILDREN_FAILED(
            reasons.said_below(last, row), failed=failed, children=self.total, last=reasons.name(last)
        )


def _of(count: int, total: int) -> str:
    number = count if count > 0 else total + count + 1
    return "all" if number == total else f"{number} of {total}"
