"""Retry: a child is tried until it succeeds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.reporting import outcome_of, speaker
from bt_tasksim.core.outcomes import Outcome, Statement, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import COUNT
from bt_tasksim.trees.nodes.base import NodeKind, Port, free_children
from bt_tasksim.trees.nodes.batch import FAILURE, Place
from bt_tasksim.trees.nodes.pass_through import said_below
from bt_tasksim.trees.nodes.rounds import BatchRounds, Rounds

ATTEMPT_FAILED = register_reason(
    "attempt_failed", "attempt {attempt} of {attempts} failed{before}", attempt=COUNT, attempts=COUNT
)
ENDLESS_ATTEMPT_FAILED = register_reason(
    "endless_attempt_failed", "attempt {attempt} failed{before}", attempt=COUNT
)


class Cause(NamedTuple):
    """Why an attempt failed: the leaf, the reason it is counted by, and the sentence."""

    leaf: str
    reason: str
    sentence: str


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
        failed = speaker(self.decorated) or self.decorated
        self.report(self._failed(said_below(self.decorated)))
        outcome = outcome_of(failed)
        if outcome is not None:
            cause = outcome.cause
            self.causes.append(Cause(failed.name, cause.reason.name, cause.own_sentence))

    def seen_from_here(self, outcome: Outcome) -> Outcome:
        """The last attempt's failure, with the causes of those before it."""
        return self._failed(outcome) if self.rounds > 1 else outcome

    def _failed(self, why: Statement | None) -> Outcome:
        return attempt_failed(why, self.rounds, self.attempts, self.causes)


def attempt_failed(why: Statement | None, attempt: int, attempts: int, causes: Sequence[Cause]) -> Outcome:
    """The failure of an attempt, with the causes of those before it.

    Args:
        why: What it says.
        attempt: Which one, from 1.
        attempts: How many there may be, or -1.
        causes: Of all attempts so far, in their order.
    """
    before = causes[: attempt - 1]
    said = f" (before it: {summary(before)})" if before else ""
    if attempts > 0:
        return ATTEMPT_FAILED(why, attempt=attempt, attempts=attempts, before=said)
    return ENDLESS_ATTEMPT_FAILED(why, attempt=attempt, before=said)


class BatchRetry(BatchRounds):
    """`Retry` in many worlds at once.

    Args:
        place: Where it stands.
        attempts: How often, or -1.
    """

    def __init__(self, place: Place, attempts: int) -> None:
        super().__init__(place, attempts, again_on=FAILURE)
        self._causes: dict[int, list[Cause]] = {}

    def tick(self, rows: Array) -> None:
        """On to the child; what was noted of an earlier activation is forgotten."""
        if self._causes:
            for row in self.begins(rows).tolist():
                self._causes.pop(row, None)
        super().tick(rows)

    def round_ended(self, rows: Array) -> None:
        """Note why."""
        for row in rows.tolist():
            name, outcome = self.batch.said(row)
            if outcome is not None:
                cause = outcome.cause
                found = Cause(name, cause.reason.name, cause.own_sentence)
                self._causes.setdefault(row, []).append(found)

    def seen_from_here(self, row: int, outcome: Outcome) -> Outcome:
        """See `Retry.seen_from_here`."""
        rounds = int(self.rounds[row])
        if rounds <= 1:
            return outcome
        return attempt_failed(outcome, rounds, self.limit, self._causes.get(row, []))


def summary(causes: Sequence[Cause]) -> str:
    """The causes in a few words: like ones are counted, and the first of them is said."""
    first: dict[tuple[str, str], Cause] = {}
    for cause in causes:
        first.setdefault(cause[:2], cause)
    often = Counter(cause[:2] for cause in causes)
    said = [
        f"{cause.leaf}: {cause.sentence}{f', {often[kind]} times' if often[kind] > 1 else ''}"
        for kind, cause in first.items()
    ]
    return "; ".join(said)


def retry(attempts: int, child: Behaviour, *, name: str = "RetryUntilSuccessful") -> Retry:
    """The child, up to so many times until it succeeds; -1 for ever.

    Raises:
        InputError: The count does not fit, or the child already has a parent.
    """
    return Retry(name, free_children(name, (child,))[0], attempts)


@register("tree node", "RetryUntilSuccessful")
class RetryUntilSuccessfulKind(NodeKind[Retry]):
    """See `Retry`."""

    category = "Decorator"
    behaviour = Retry
    symbol = "↺"
    label = "retry"
    ports = (Port("num_attempts", doc="how often, -1 without end"),)
    helper = staticmethod(retry)

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> Retry:
        """See `NodeKind.make`."""
        return retry(ports["num_attempts"], children[0], name=name)

    def read(self, node: Retry) -> dict[str, int]:
        """See `NodeKind.read`."""
        return {"num_attempts": node.attempts}

    def describe(self, node: Retry) -> str:
        """See `NodeKind.describe`."""
        often = "without end" if node.attempts < 0 else f"up to {node.attempts} times"
        return f"{self.label} {often}"

    def compiled(self, node: Retry, place: Place) -> BatchRetry:
        """See `NodeKind.compiled`."""
        return BatchRetry(place, node.limit)
