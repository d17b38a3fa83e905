"""Retry: a child is tried until it succeeds."""

from __future__ import annotations

from collections.abc import Mapping

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import COUNT
from bt_tasksim.trees.nodes.base import NodeKind, Port, free_children
from bt_tasksim.trees.nodes.pass_through import said_below
from bt_tasksim.trees.nodes.rounds import Rounds

ATTEMPT_FAILED = register_reason(
    "attempt_failed", "attempt {attempt} of {attempts} failed", attempt=COUNT, attempts=COUNT
)
ENDLESS_ATTEMPT_FAILED = register_reason("endless_attempt_failed", "attempt {attempt} failed", attempt=COUNT)


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

    def report_round(self) -> None:
        """Say which attempt failed, and why."""
        why = said_below(self.decorated)
        if self.attempts > 0:
            self.report(ATTEMPT_FAILED(why, attempt=self.rounds, attempts=self.attempts))
        else:
            self.report(ENDLESS_ATTEMPT_FAILED(why, attempt=self.rounds))


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
