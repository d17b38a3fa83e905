"""What retry and repeat share: a child that is ticked anew within the same tick."""

from __future__ import annotations

import abc
from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.core.errors import InputError
from bt_tasksim.trees.nodes.pass_through import PassThrough, end_tick, said_below


class Rounds(PassThrough, abc.ABC):
    """Ticks its child anew whenever it ends in ``again_on``, up to a limit.

    Args:
        name: The node's name.
        child: What is ticked.
        limit: How often, or -1.
        again_on: The status after which another round begins.

    Raises:
        InputError: ``limit`` is neither positive nor -1.
    """

    def __init__(self, name: str, child: Behaviour, limit: int, again_on: Status) -> None:
        super().__init__(name, child)
        if isinstance(limit, bool) or not isinstance(limit, int) or (limit < 1 and limit != -1):
            raise InputError(f"'{name}': its count should be a positive whole number, or -1, found {limit!r}")
        self.limit, self.again_on = limit, again_on
        self.rounds = 0

    def initialise(self) -> None:
        """Begin to count."""
        self.rounds = 0

    @abc.abstractmethod
    def report_round(self) -> None:
        """Say that a round has ended."""

    def tick(self) -> Iterator[Behaviour]:
        """One tick, which may hold the end of one round and the beginning of the next."""
        if self.status != Status.RUNNING:
            self.report(None)
            self.initialise()
        child = self.decorated
        while True:
            began = child.status != Status.RUNNING
            yield from child.tick()
            status = child.status
            if status == self.again_on:
                self.rounds += 1
                self.report_round()
                if self.rounds == self.limit:
                    break
                if not began:
                    continue
                status = Status.RUNNING
            elif status == Status.FAILURE:
                self.report(said_below(child))
            break
        yield from end_tick(self, status)
