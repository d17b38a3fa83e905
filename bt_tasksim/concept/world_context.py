"""One world of a batch, as the context of leaves that py_trees ticks there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.beliefs import Beliefs, Believed
from bt_tasksim.concept.context import NO_EPISODE, Context, Refusal, Written, only_world
from bt_tasksim.core.facts_table import FactsTable
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Command, Hidden, Observation, WorldModel


class WorldContext(Context):
    """A view of one world of a context: what it says is the world's row, and what is written goes there.

    To its leaves it is the context of a batch of one, in NumPy: the world is number 0, and names have the
    columns that they have where it is run alone. It keeps nothing of its own.

    Args:
        batch: The context of all worlds, which begins and goes on.
        row: Which world.
    """

    def __init__(self, batch: Context, row: int) -> None:
        self._batch, self._row = batch, np.array([row])
        self.robot, self.worlds, self.like, self.rows = batch.robot, 1, np.empty(0), np.arange(1)
        self.ask_hidden = self._hidden
        self._arranged: tuple[Observation, FactsTable, Observation] | None = None

    @property
    def times(self) -> Array:
        """See `Context.times`."""
        return self._batch.times[self._row]

    @times.setter
    def times(self, seconds: Array) -> None:
        self._batch.times[self._row] = seconds

    @property
    def refused(self) -> dict[int, Refusal]:
        """See `Context.refused`."""
        found = self._batch.refused.get(int(self._row[0]))
        return {} if found is None else {0: found}

    @property
    def looked(self) -> Observation | None:
        """See `Context.looked`."""
        found = self._batch.looked
        return None if found is None else only_world(found, int(self._row[0]))

    @property
    def observation(self) -> Observation:
        """See `Context.observation`."""
        looked, facts, known = self._batch.looked, self.facts_table, self._arranged
        if looked is None:
            raise RuntimeError(NO_EPISODE)
        if known is None or known[0] is not looked or known[1] is not facts:
            self._arranged = known = looked, facts, facts.arranged(only_world(looked, int(self._row[0])))
        return known[2]

    @property
    def beliefs(self) -> Beliefs:
        """See `Context.beliefs`."""
        return self._batch.beliefs

    @property
    def believed(self) -> Believed:
        """See `Context.believed`."""
        return Believed(self.observation.objects, self.beliefs.of_world(int(self._row[0]))[None])

    @property
    def facts_table(self) -> FactsTable:
        """See `Context.facts_table`."""
        return self._batch.facts_table.of_world(int(self._row[0]))

    @property
    def written(self) -> Written:
        """See `Context.written`."""
        return self._batch.written_in(int(self._row[0]))

    def written_in(self, world: int) -> Written:
        """See `Context.written_in`."""
        return self._batch.written_in(int(self._row[world]))

    def begin(self, models: Sequence[WorldModel], rows: Array | None = None) -> None:
        """Not here: episodes begin in the batch.

        Raises:
            RuntimeError: In any case.
        """
        raise RuntimeError("a world of a batch begins with the batch's context")

    def advance(self, observation: Observation, rows: Array | None = None) -> None:
        """Not here: worlds go on in the batch.

        Raises:
            RuntimeError: In any case.
        """
        raise RuntimeError("a world of a batch goes on with the batch's context")

    def write(self, command: Command, rows: Array, leaf: Behaviour) -> None:
        """See `Context.write`."""
        self._batch.write(command, self._row[rows], leaf)

    def writer_of(self, part: str, world: int = 0) -> Behaviour | None:
        """See `Context.writer_of`."""
        return self._batch.writer_of(part, int(self._row[world]))

    def withdraw(self, leaf: Behaviour, rows: Array) -> None:
        """See `Context.withdraw`."""
        self._batch.withdraw(leaf, self._row[rows])

    def reach(self, goal: str, target: str, rows: Array) -> None:
        """See `Context.reach`."""
        self._batch.reach(goal, target, self._row[rows])

    def end(self, goal: str, target: str, rows: Array) -> None:
        """See `Context.end`."""
        self._batch.end(goal, target, self._row[rows])

    def reached(self, goal: str, target: str, rows: Array) -> Array:
        """See `Context.reached`."""
        return self._batch.reached(goal, target, self._row[rows])

    def led_nowhere(self, goal: str, target: str, row: int, counts: float = 1.0) -> None:
        """See `Context.led_nowhere`."""
        self._batch.led_nowhere(goal, target, int(self._row[row]), counts)

    def dead_ends(self, goal: str, target: str, rows: Array) -> Array:
        """See `Context.dead_ends`."""
        return self._batch.dead_ends(goal, target, self._row[rows])

    def note(self, model: Any, succeeded: bool, rows: Array) -> None:
        """See `Context.note`: of copies, which end with their episode, nothing is kept."""

    def succeeded(self, models: Sequence[Any], rows: Array) -> Array:
        """See `Context.succeeded`."""
        return np.zeros((len(rows), len(models)), bool)

    def _hidden(self, rows: Array | None = None) -> Hidden | None:
        found = self._batch.ask_hidden(self._row)
        return None if found is None else only_world(found, 0)
