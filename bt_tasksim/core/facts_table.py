"""What is known beforehand of the worlds of a batch that begin anew one by one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from bt_tasksim.core.columns import Order
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.core.poses import Array
from bt_tasksim.core.transfer import Index
from bt_tasksim.core.world import Hidden, Observation, WorldModel

_B = TypeVar("_B", Observation, Hidden)


class FactsTable:
    """The facts of a batch whose worlds begin anew one by one.

    Args:
        worlds: How many there are.
        like: An array of the library, type and device of the facts; by default NumPy.
    """

    def __init__(self, worlds: int, like: Array | None = None) -> None:
        self._like: Array = np.empty(0) if like is None else like
        self._models: list[WorldModel | None] = [None] * worlds
        self._facts: WorldFacts | None = None
        self._order: Order | None = None
        self._stale: set[int] = set()
        self._taken: dict[bytes, WorldFacts] = {}
        self._single: dict[int, FactsTable] = {}

    def replace(self, rows: Array, models: Sequence[WorldModel]) -> None:
        """Other worlds begin at ``rows (k,)``.

        Raises:
            InputError: See `WorldFacts.of`.
        """
        for row, model in zip(rows.tolist(), models, strict=True):
            self._models[row] = model
            self._stale.add(row)
            self._single.pop(row, None)
        self._taken.clear()

    @property
    def facts(self) -> WorldFacts | None:
        """The facts of all worlds; those that never began have the facts of one that did. None before any.

        Raises:
            InputError: See `WorldFacts.of`.
        """
        if self._stale:
            rows, known = sorted(self._stale), self._facts
            begun = [model for model in self._models if model is not None]
            if known is None or _names(begun) != (set(known.columns), set(known.place_columns)):
                worlds = [begun[0] if model is None else model for model in self._models]
                made = WorldFacts.of(worlds)
                self._facts = made.sent(self._like)
                self._order = Order.of(worlds, list(made.columns))
            else:
                fresh = [model for row in rows if (model := self._models[row]) is not None]
                anew = WorldFacts.of(fresh, list(known.columns), list(known.place_columns))
                self._facts = known.replaced(np.array(rows), anew.sent(self._like))
                assert self._order is not None, "it is made with the facts"
                self._order = self._order.replaced(np.array(rows), Order.of(fresh, list(known.columns)))
            self._stale.clear()
        return self._facts

    def arranged(self, bundle: _B, rows: Array | None = None) -> _B:
        """An observation or a hidden state ``(k, ...)`` with the columns of the facts, see `Order.arranged`.

        Args:
            bundle: Of worlds whose objects stand in their own orders.
            rows: Which ``(k,)``; by default all.
        """
        return bundle if self.facts is None or self._order is None else self._order.arranged(bundle, rows)

    def of_world(self, row: int) -> FactsTable:
        """The facts of one world alone, in NumPy, with columns for its own objects and places only."""
        if row not in self._single:
            table, model = FactsTable(1), self._models[row]
            if model is not None:
                table.replace(np.zeros(1, int), [model])
            self._single[row] = table
        return self._single[row]

    def taken(self, index: Index) -> WorldFacts:
        """The facts of some worlds."""
        key = index.rows.tobytes()
        if key not in self._taken:
            facts = self.facts
            assert facts is not None, "worlds have begun"
            if len(self._taken) > 64:
                self._taken.clear()
            self._taken[key] = facts.map(index.of)
        return self._taken[key]


def _names(models: Sequence[WorldModel]) -> tuple[set[str], set[str]]:
    """Names of all objects, and of all places."""
    return {n for model in models for n in model.index}, {n for model in models for n in model.places}
