"""What retry and repeat share: a child that is ticked anew within the same tick."""

from __future__ import annotations

import abc
from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.reporting import said_below
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.trees.nodes.batch import RUNNING, BatchNode, NodePlace
from bt_tasksim.trees.nodes.pass_through import PassThrough, end_tick


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

    def ticked(self, began: bool, status: Status) -> None:  # most have nothing to notice
        """The child has ended its tick.

        Args:
            began: It began in this tick.
            status: Its status.
        """

    def is_enough(self) -> bool:
        """After this round there is no other one, whatever the limit."""
        return False

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
            self.ticked(began, status)
            if status == self.again_on:
                self.rounds += 1
                self.report_round()
                if self.rounds == self.limit or self.is_enough():
                    break
                if not began:
                    continue
                status = Status.RUNNING
            elif status == Status.FAILURE:
                self.report(said_below(child))
            break
        yield from end_tick(self, status)


class BatchRounds(BatchNode):
    """`Rounds` in many worlds at once.

    Args:
        place: Where it stands.
        limit: How often, or -1.
        again_on: The status after which another round begins.
    """

    def __init__(self, place: NodePlace, limit: int, again_on: int) -> None:
        super().__init__(place)
        self.limit, self.again_on = limit, again_on
        self.rounds = self.arrays.full(0, "int64")
        """``(N,)`` rounds that have ended."""
        self.began = self.arrays.full(False, "bool")
        """``(N,)`` the child began in this tick."""

    def tick(self, rows: Array) -> None:
        """On to the child."""
        begins = self.begins(rows)
        if len(begins):
            self.rounds[begins] = 0
            self.count_anew(begins)
        began = self.place.child_status[0][rows] != RUNNING
        self.began[rows] = began
        self.round_begins(self.part(rows, began))
        self.tick_child(0, rows)

    def count_anew(self, rows: Array) -> None:  # a repeat remembers nothing
        """It begins in worlds."""

    def round_begins(self, rows: Array) -> None:
        """A round begins in worlds."""

    def round_ended(self, rows: Array) -> None:
        """A round has ended in worlds, and is counted."""

    def ticked(self, rows: Array, status: Array) -> None:
        """The child has ended its tick in worlds, with statuses ``(k,)``."""

    def is_enough(self, rows: Array) -> Array:
        """Booleans ``(k,)``: after this round there is no other one, whatever the limit."""
        return self.xp.zeros_like(rows, dtype=self.xp.bool)

    def after(self, child: int, rows: Array, status: Array) -> None:
        """Back, or to the child anew."""
        self.ticked(rows, status)
        (again, _), (over, said) = self.split(status == self.again_on, rows, status)
        self.end(over, said)
        if not len(again):
            return
        self.rounds[again] += 1
        self.round_ended(again)
        (enough,), (again,) = self.split((self.rounds[again] == self.limit) | self.is_enough(again), again)
        self.end(enough, self.again_on)
        (wait,), (again,) = self.split(self.began[again], again)
        self.end(wait, RUNNING)
        self.began[again] = True
        self.round_begins(again)
        self.tick_child(0, again)
