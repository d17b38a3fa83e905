"""Nodes of BehaviorTree.CPP v4 that py_trees lacks or has with other semantics.

Time is episode time, from the tree's `Context`: the wall clock plays no part, so that simulation is
deterministic. None of these nodes commands anything; in a tick in which nothing acts the robot holds its last
target.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite
from py_trees.decorators import Decorator

from bt_tasksim.context import Context
from bt_tasksim.errors import InputError

SLACK = 1e-9
"""Seconds by which summed control periods may fall short of a time."""


class PassThrough(Decorator):
    """A decorator whose status is its child's."""

    def update(self) -> Status:
        """The child's status."""
        return self.decorated.status


class Retry(PassThrough):
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

    default_name: ClassVar[str] = "RetryUntilSuccessful"

    def __init__(self, name: str, child: Behaviour, attempts: int) -> None:
        super().__init__(name, child)
        self.attempts = _count(attempts, name, "attempts")
        self.failures = 0

    def initialise(self) -> None:
        """Begin to count."""
        self.failures = 0

    def tick(self) -> Iterator[Behaviour]:
        """One tick, which may hold the end of one attempt and the beginning of the next."""
        yield from _loop(self, self.attempts, Status.FAILURE)

    def _again(self) -> int:
        self.failures += 1
        of = f" of {self.attempts}" if self.attempts > 0 else ""
        self.feedback_message = f"attempt {self.failures}{of} failed: {_why(self.decorated)}"
        return self.failures


class Repeat(PassThrough):
    """Ticks its child until it has succeeded ``times`` times in a row (-1: without end), unless it fails.

    A child that succeeds is ticked anew in the same tick; if it succeeded in the very tick in which it began,
    the next round waits for the next tick.

    Args:
        name: The node's name.
        child: What is repeated.
        times: How often, or -1.

    Raises:
        InputError: ``times`` is neither positive nor -1.
    """

    default_name: ClassVar[str] = "Repeat"

    def __init__(self, name: str, child: Behaviour, times: int) -> None:
        super().__init__(name, child)
        self.times = _count(times, name, "times")
        self.successes = 0

    def initialise(self) -> None:
        """Begin to count."""
        self.successes = 0

    def tick(self) -> Iterator[Behaviour]:
        """One tick, which may hold the end of one round and the beginning of the next."""
        yield from _loop(self, self.times, Status.SUCCESS)

    def _again(self) -> int:
        self.successes += 1
        of = f" of {self.times}" if self.times > 0 else ""
        self.feedback_message = f"round {self.successes}{of} done"
        return self.successes


class Timeout(PassThrough):
    """Stops its child and fails when ``seconds`` of episode time have passed since it began.

    The child is not ticked in the tick in which its time is over.

    Args:
        name: The node's name.
        child: What may take only so long.
        seconds: Its time, a whole number of milliseconds after rounding.

    Raises:
        InputError: ``seconds`` is not a number of at least 0.001.
    """

    default_name: ClassVar[str] = "Timeout"

    def __init__(self, name: str, child: Behaviour, seconds: float) -> None:
        super().__init__(name, child)
        if isinstance(seconds, bool | str) or not 0.001 <= seconds <= 4e6:
            raise InputError(f"'{name}': seconds should be a number between 0.001 and 4e6, found {seconds!r}")
        self.seconds = round(seconds * 1000) / 1000
        self._context: Context | None = None
        self._started = 0.0

    def setup(self, **kwargs: Any) -> None:
        """Take the tree's context.

        Raises:
            InputError: There is none: the tree was set up without a Runner.
        """
        context = kwargs.get("context")
        if not isinstance(context, Context):
            raise InputError(f"'{self.name}' counts episode time and needs a context: run it with a Runner")
        self._context = context

    def tick(self) -> Iterator[Behaviour]:
        """One tick.

        Raises:
            RuntimeError: The tree was not set up.
        """
        if self._context is None:
            raise RuntimeError(f"'{self.name}' was ticked before it was set up")
        now = self._context.now
        if self.status != Status.RUNNING:
            self._started = now
            self.feedback_message = ""
        elif now - self._started >= self.seconds - SLACK:
            self.feedback_message = f"not done within {self.seconds:g} s: {_why(self.decorated)}"
            self.decorated.stop(Status.INVALID)
            yield from _end(self, Status.FAILURE)
            return
        yield from self.decorated.tick()
        yield from _end(self, self.decorated.status)


class SubTree(PassThrough):
    """A tree within a tree: passes ticks and statuses through. Its file keeps it as a tree of its own."""

    def update(self) -> Status:
        """The child's status."""
        self.feedback_message = self.decorated.feedback_message
        return self.decorated.status


class Parallel(Composite):
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

    def tick(self) -> Iterator[Behaviour]:
        """One tick."""
        if self.status != Status.RUNNING:
            self._finished.clear()
            for child in self.children:
                if child.status != Status.INVALID:
                    child.stop(Status.INVALID)
            self.feedback_message = ""
            self.initialise()
        total = len(self.children)
        needed, allowed = (c if c > 0 else total + c + 1 for c in (self.success_count, self.failure_count))
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
                self.feedback_message = f"{failed} of {total} failed, last '{child.name}': {_why(child)}"
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


def _count(value: Any, name: str, what: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or (value < 1 and value != -1):
        raise InputError(f"'{name}': {what} should be a positive whole number, or -1, found {value!r}")
    return value


def _loop(node: Retry | Repeat, limit: int, again_on: Status) -> Iterator[Behaviour]:
    if node.status != Status.RUNNING:
        node.feedback_message = ""
        node.initialise()
    child = node.decorated
    while True:
        began = child.status != Status.RUNNING
        yield from child.tick()
        status = child.status
        if status == again_on:
            if node._again() == limit:
                break
            if not began:
                continue
            status = Status.RUNNING
        elif status == Status.FAILURE:
            node.feedback_message = _why(child)
        break
    yield from _end(node, status)


def _end(node: Decorator, status: Status) -> Iterator[Behaviour]:
    if status != Status.RUNNING:
        node.stop(status)
    node.status = status
    yield node


def _why(node: Behaviour) -> str:
    """The feedback of the deepest node that has one to give."""
    tip = node.tip()
    return str(
        (tip.feedback_message if tip is not None else "") or node.feedback_message or "no reason given"
    )
