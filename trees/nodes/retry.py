"""Retry: a child is tried until it succeeds."""

from __future__ import annotations

import abc
from collections.abc import Mapping, Sequence
from typing import TypeVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.reporting import said_below
from bt_tasksim.core.outcomes import Outcome, Statement, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import COUNT
from bt_tasksim.trees.nodes.base import NodeKind, Port, free_children
from bt_tasksim.trees.nodes.batch import FAILURE, NodePlace
from bt_tasksim.trees.nodes.causes import Cause, batch_cause_of, cause_of, summary
from bt_tasksim.trees.nodes.rounds import BatchRounds, Rounds

ATTEMPT_FAILED = register_reason(
    "attempt_failed", "attempt {attempt} of {attempts} failed{before}", attempt=COUNT, attempts=COUNT
)
ENDLESS_ATTEMPT_FAILED = register_reason(
    "endless_attempt_failed", "attempt {attempt} failed{before}", attempt=COUNT
)


class Retry(Rounds):
    """Ticks its child until it succeeds, at most ``attempts`` times (-1: without end).

    A child that fails is ticked anew in the same tick. Only if it failed in the very tick in which it began,
    the next attempt waits for the next tick (RUNNING meanwhile): the observation would be the same.

    Args:
        name: The node's name.
        child: What is tried.
        attempts: How often, or -1.

    Raises:
        InputError: ``attempts`` is neither positive nor -1.
    """

    def __init__(self, name: str, child: Behaviour, attempts: int) -> None:
        super().__init__(name, child, attempts, again_on=Status.FAILURE)
        self.attempts = attempts

    def initialise(self) -> None:
        """Begin to count."""
        super().initialise()
        self.causes: list[Cause] = []

    def report_round(self) -> None:
        """Say which attempt failed, and why, and why those before it did."""
        self.report(self._failed(said_below(self.decorated)))
        cause = cause_of(self.decorated)
        if cause is not None:
            self.causes.append(cause)

    def seen_from_here(self, outcome: Outcome) -> Outcome:
        """The last attempt's failure, with the causes of those before it."""
        return self._failed(outcome) if self.rounds > 1 else outcome

    def _failed(self, why: Statement | None) -> Outcome:
        return attempt_failed(self.rounds, self.attempts, self.causes, why)


def attempt_failed(attempt: int, attempts: int, causes: Sequence[Cause], why: Statement | None) -> Outcome:
    """Which attempt failed, and why, and why those before it did."""
    before = causes[: attempt - 1]
    said = f" (before it: {summary(before)})" if before else ""
    if attempts > 0:
        return ATTEMPT_FAILED(why, attempt=attempt, attempts=attempts, before=said)
    return ENDLESS_ATTEMPT_FAILED(why, attempt=attempt, before=said)


def retry(attempts: int, child: Behaviour, *, name: str = "RetryUntilSuccessful") -> Retry:
    """The child, up to so many times until it succeeds; -1 for ever.

    Raises:
        InputError: The count does not fit, or the child already has a parent.
    """
    return Retry(name, free_children(name, (child,))[0], attempts)


RetryT = TypeVar("RetryT", bound=Retry)


class AttemptsKind(NodeKind[RetryT], abc.ABC):
    """A kind of node whose port says how often its child is tried."""

    category = "Decorator"

    def read(self, node: RetryT) -> dict[str, int]:
        """See `NodeKind.read`."""
        return {"num_attempts": node.attempts}


@register("tree node", "RetryUntilSuccessful")
class RetryUntilSuccessfulKind(AttemptsKind[Retry]):
    """See `Retry`."""

    behaviour = Retry
    symbol = "↺"
    label = "retry"
    ports = (Port("num_attempts", doc="how often, -1 without end"),)
    helper = staticmethod(retry)

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> Retry:
        """See `NodeKind.make`."""
        return retry(ports["num_attempts"], children[0], name=name)

    def describe(self, node: Retry) -> str:
        """See `NodeKind.describe`."""
        often = "without end" if node.attempts < 0 else f"up to {node.attempts} times"
        return f"{self.label} {often}"

    def compiled(self, node: Retry, place: NodePlace) -> BatchRetry:
        """See `NodeKind.compiled`."""
        return BatchRetry(place, node.limit, again_on=FAILURE)


class BatchRetry(BatchRounds):
    """`Retry` in many worlds at once; why attempts failed is kept world by world."""

    def __init__(self, place: NodePlace, limit: int, again_on: int) -> None:
        super().__init__(place, limit, again_on)
        self._causes: dict[int, list[Cause]] = {}
        self._why: dict[int, Statement | None] = {}

    def count_anew(self, rows: Array) -> None:
        """Forget what was."""
        if self._why:
            for row in rows.tolist():
                self._causes.pop(row, None)
                self._why.pop(row, None)

    def round_ended(self, rows: Array) -> None:
        """Remember which attempt failed, and why."""
        child, reasons = self.place.children[0], self.batch.reasons
        for row in rows.tolist():
            self._why[row] = reasons.said_below(child, row)
            cause = batch_cause_of(reasons, child, row)
            if cause is not None:
                self._causes.setdefault(row, []).append(cause)

    def says(self, row: int) -> Statement | None:
        """Which attempt failed last, and why, and why those before it did."""
        return self._failed(row, self._why.get(row)) if int(self.rounds[row]) else None

    def adds(self, row: int, outcome: Outcome) -> Outcome:
        """The last attempt's failure, with the causes of those before it."""
        return self._failed(row, outcome) if int(self.rounds[row]) > 1 else outcome

    def _failed(self, row: int, why: Statement | None) -> Outcome:
        return attempt_failed(int(self.rounds[row]), self.limit, self._causes.get(row, []), why)
