"""Retry while acting: a child is tried again only if something has acted in the attempt that failed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.core.outcomes import Outcome, Statement, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import COUNT
from bt_tasksim.trees.nodes.acting import acts
from bt_tasksim.trees.nodes.base import Port, free_children
from bt_tasksim.trees.nodes.batch import FAILURE, RUNNING, NodePlace
from bt_tasksim.trees.nodes.causes import Cause, summary
from bt_tasksim.trees.nodes.retry import AttemptsKind, BatchRetry, Retry

NOTHING_DONE = register_reason(
    "nothing_done",
    "nothing could be done in attempt {attempt}, so it was the last one{before}",
    attempt=COUNT,
)


class RetryWhileActing(Retry):
    """A `Retry` that ends with an attempt in which nothing has acted: another one would be the same.

    Args:
        name: The node's name.
        child: What is tried.
        attempts: How often at most, or -1.

    Raises:
        InputError: ``attempts`` is neither positive nor -1.
    """

    def initialise(self) -> None:
        """Begin to count."""
        super().initialise()
        self._acted = False

    def ticked(self, began: bool, status: Status) -> None:
        """Notice whether anything acts."""
        if began:
            self._acted = False
        if status == Status.RUNNING and not self._acted:
            self._acted = acts(self.decorated)

    def is_enough(self) -> bool:
        """Nothing has acted."""
        return not self._acted

    def _failed(self, why: Statement | None) -> Outcome:
        return super()._failed(why) if self._acted else nothing_done(self.rounds, self.causes, why)


def nothing_done(attempt: int, causes: Sequence[Cause], why: Statement | None) -> Outcome:
    """Why nothing was done in an attempt, and why those before it failed."""
    before = causes[: attempt - 1]
    said = f" (before it: {summary(before)})" if before else ""
    return NOTHING_DONE(why, attempt=attempt, before=said)


def retry_while_acting(
    attempts: int, child: Behaviour, *, name: str = "RetryWhileActing"
) -> RetryWhileActing:
    """The child, up to so many times until it succeeds, or nothing has acted in an attempt; -1 for ever.

    Raises:
        InputError: The count does not fit, or the child already has a parent.
    """
    return RetryWhileActing(name, free_children(name, (child,))[0], attempts)


@register("tree node", "RetryWhileActing")
class RetryWhileActingKind(AttemptsKind[RetryWhileActing]):
    """See `RetryWhileActing`."""

    behaviour = RetryWhileActing
    symbol = "↺ᴬ"
    label = "retry while it acts"
    own = True
    ports = (Port("num_attempts", doc="how often at most, -1 without end"),)
    helper = staticmethod(retry_while_acting)

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> RetryWhileActing:
        """See `NodeKind.make`."""
        return retry_while_acting(ports["num_attempts"], children[0], name=name)

    def describe(self, node: RetryWhileActing) -> str:
        """See `NodeKind.describe`."""
        often = "without end" if node.attempts < 0 else f"up to {node.attempts} times"
        return f"{self.label}, {often}"

    def compiled(self, node: RetryWhileActing, place: NodePlace) -> BatchRetryWhileActing:
        """See `NodeKind.compiled`."""
        return BatchRetryWhileActing(place, node.limit, again_on=FAILURE)


class BatchRetryWhileActing(BatchRetry):
    """`RetryWhileActing` in many worlds at once."""

    def __init__(self, place: NodePlace, limit: int, again_on: int) -> None:
        super().__init__(place, limit, again_on)
        self.acted = self.arrays.full(False, "bool")
        """``(N,)`` something has acted in this attempt."""

    def round_begins(self, rows: Array) -> None:
        """Nothing has acted yet."""
        self.acted[rows] = False

    def ticked(self, rows: Array, status: Array) -> None:
        """Notice whether anything acts."""
        quiet = self.part(rows, (status == RUNNING) & ~self.acted[rows])
        if len(quiet):
            self.acted[self.part(quiet, self.batch.acting(self.place.children[0], quiet))] = True

    def is_enough(self, rows: Array) -> Array:
        """Nothing has acted."""
        return ~self.acted[rows]

    def _failed(self, row: int, why: Statement | None) -> Outcome:
        if bool(self.acted[row]):
            return super()._failed(row, why)
        return nothing_done(int(self.rounds[row]), self._causes.get(row, []), why)
