"""What control nodes and decorators are when one tree is ticked in many worlds at once.

A node of py_trees is ticked by a call that returns when its children have been ticked. Here each node is two
functions of worlds: what it does when they begin to tick it (`BatchNode.tick`), and what when a child has
ended its tick there (`BatchNode.after`). Each sends every world on: to one of the children, or back to the
parent with a status. So a tick can stand still before a leaf in one world while others go on, and it needs
no stack.
"""

from __future__ import annotations

import abc
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import methodcaller
from typing import Any, Protocol

import array_api_compat.numpy
import numpy as np

from bt_tasksim.core.batch_leaf import FAILURE, INVALID, RUNNING, SUCCESS
from bt_tasksim.core.outcomes import TEXT, Outcome, Statement
from bt_tasksim.core.poses import Array, array_namespace

__all__ = [
    "FAILURE", "INVALID", "RUNNING", "SUCCESS", "Arrays", "Batch", "BatchNode", "PassesOn", "NodePlace",
]  # fmt: skip


class Arrays:
    """The array library, the device and the number of worlds of a batch.

    Args:
        worlds: How many.
        xp: The library, such as ``numpy`` or ``torch``.
        device: One of the library's devices; None: its default.
    """

    def __init__(self, worlds: int, xp: Any = np, device: Any = None) -> None:
        self.worlds, self.device = worlds, device
        self.xp = array_namespace(xp.zeros(0))
        self._count, self._nonzero = xp.count_nonzero, self.xp.nonzero
        if self.xp is array_api_compat.numpy:  # without the wrapper, most of the time of a small batch
            self._nonzero = methodcaller("nonzero")

    def full(self, value: float | bool, dtype: str, *shape: int) -> Array:
        """A number for each world: ``(*shape, N)``."""
        kind = getattr(self.xp, dtype)
        return self.xp.full((*shape, self.worlds), value, dtype=kind, device=self.device)

    def indices(self, count: int) -> Array:
        """A 0 for each world ``(N,)``, to become any number below ``count``: short ones sort much faster."""
        return self.full(0, "int16" if count <= 2**15 else "int32")

    def statuses(self, rows: Array, status: int) -> Array:
        """The same status ``(k,)`` for all rows ``(k,)``."""
        return self.xp.full(rows.shape, status, dtype=self.xp.int8, device=self.device)

    def count(self, mask: Array) -> int:
        """How many of a mask hold."""
        return int(self._count(mask))

    def where(self, mask: Array) -> Array:
        """Indices at which a mask ``(k,)`` holds."""
        found: Array = self._nonzero(mask)[0]
        return found

    def groups(self, keys: Array, rows: Array) -> Iterator[tuple[int, Array]]:
        """Rows ``(k,)`` by their keys ``(k,)``: each key once."""
        if not len(keys):
            return
        first = int(keys[0])
        if self.count(keys == first) == len(keys):
            yield first, rows
            return
        order = self.xp.argsort(keys, stable=True)
        keys, rows = keys[order], rows[order]
        starts = [0, *(self.where(keys[1:] != keys[:-1]) + 1).tolist(), len(keys)]
        for start, end in pairwise(starts):
            yield int(keys[start]), rows[start:end]


class Batch(Protocol):
    """What nodes see of the tree that is ticked; nodes are numbers, in the order of `trees.walk`."""

    arrays: Arrays
    now: Array
    """``(N,)`` seconds since each world's episode began."""

    def tick_node(self, node: int, rows: Array) -> None:
        """Let worlds tick a node next."""

    def end_node(self, node: int, rows: Array, status: Array) -> None:
        """A node ends its tick with statuses ``(k,)``."""

    def stop_node(self, node: int, rows: Array) -> None:
        """Stop a node, as py_trees' ``stop(INVALID)``."""

    def acting(self, node: int, rows: Array) -> Array:
        """Booleans ``(k,)``: a leaf, at or below a node, is RUNNING (see `trees.nodes.acting`)."""

    @property
    def reasons(self) -> Reasons:
        """What nodes say."""


class Reasons(Protocol):
    """What nodes see of what other nodes say in a world, see `bt_tasksim.execution.batch_reasons`."""

    def name(self, node: int) -> str:
        """A node's name."""

    def tip(self, node: int, row: int) -> int | None:
        """The deepest node that was decided last, at or below a node; None where it is not active."""

    def outcome_of(self, node: int, row: int) -> Outcome | None:
        """What a node says itself, as an outcome."""

    def said_by(self, node: int, row: int) -> Statement | None:
        """What a node says itself."""

    def said_below(self, node: int, row: int) -> Statement | None:
        """What the deepest node says that has something to say."""

    def speaker(self, node: int, row: int) -> int | None:
        """The node, at or below one that has failed, that made it fail."""


@dataclass(frozen=True)
class NodePlace:
    """Where a node stands in a batch.

    Attributes:
        batch: The tree that is ticked.
        node: The node's number.
        status: ``(N,)`` its statuses.
        children: Numbers of its children.
        child_status: ``(N,)`` for each child, its statuses.
    """

    batch: Batch
    node: int
    status: Array
    children: tuple[int, ...]
    child_status: tuple[Array, ...]


class BatchNode(abc.ABC):
    """A control node or decorator in all worlds of a batch. Worlds are rows ``(k,)`` of different numbers."""

    def __init__(self, place: NodePlace) -> None:
        self.place, self.batch, self.arrays = place, place.batch, place.batch.arrays
        self.xp = self.arrays.xp

    @abc.abstractmethod
    def tick(self, rows: Array) -> None:
        """Worlds begin to tick the node; each is sent on."""

    @abc.abstractmethod
    def after(self, child: int, rows: Array, status: Array) -> None:
        """A child has ended its tick with statuses ``(k,)``; each world is sent on.

        Args:
            child: Which child, from 0.
            rows: The worlds.
            status: ``(k,)`` what it ended with.
        """

    def stopped(self, rows: Array) -> None:  # noqa: B027  # most have nothing to do
        """It is stopped in worlds where it was RUNNING."""

    def current(self, row: int) -> int | None:
        """The child that was decided last in a world, or None; that of a decorator is its only one."""
        return 0 if int(self.place.child_status[0][row]) != INVALID else None

    def says(self, row: int) -> Statement | None:
        """What the node itself has to say in a world: an outcome, or words; None for nothing."""
        return None

    def adds(self, row: int, outcome: Outcome) -> Outcome:
        """What a failure below, which made this node fail, comes to here: with what was tried before."""
        return outcome

    def begins(self, rows: Array) -> Array:
        """The worlds among rows in which the node begins anew."""
        return self.part(rows, self.place.status[rows] != RUNNING)

    def part(self, rows: Array, mask: Array) -> Array:
        """Those rows for which a mask ``(k,)`` holds."""
        found = self.arrays.where(mask)
        return rows if len(found) == len(rows) else rows[found]

    def split(self, mask: Array, rows: Array, *more: Array) -> tuple[list[Array], list[Array]]:
        """Arrays ``(k,)`` where a mask holds, and where it does not."""
        arrays, yes = [rows, *more], self.arrays.where(mask)
        if len(yes) == len(rows):
            return arrays, [a[:0] for a in arrays]
        if not len(yes):
            return [a[:0] for a in arrays], arrays
        no = self.arrays.where(~mask)
        return [a[yes] for a in arrays], [a[no] for a in arrays]

    def tick_child(self, child: int, rows: Array) -> None:
        """Let worlds tick a child next."""
        if len(rows):
            self.batch.tick_node(self.place.children[child], rows)

    def end(self, rows: Array, status: Array | int) -> None:
        """End the node's tick with one status, or with one for each row."""
        if len(rows):
            if isinstance(status, int):
                status = self.arrays.statuses(rows, status)
            self.batch.end_node(self.place.node, rows, status)

    def stop_child(self, child: int, rows: Array) -> None:
        """Stop a child, wherever it is active or has ended."""
        if len(rows):
            alive = self.part(rows, self.place.child_status[child][rows] != INVALID)
            if len(alive):
                self.batch.stop_node(self.place.children[child], alive)

    def stop_children(self, rows: Array, which: Sequence[int] | None = None) -> None:
        """Stop children, by default all, from left to right."""
        if len(rows):
            for child in range(len(self.place.children)) if which is None else which:
                self.stop_child(child, rows)

    def stop_ended(self, rows: Array) -> None:
        """Stop children that have ended, before they begin anew; below an INVALID node there are none."""
        self.stop_children(self.part(rows, self.place.status[rows] > RUNNING))


class PassesOn(BatchNode):
    """A decorator that ticks its child once and ends with its status, or with another one in its place.

    Args:
        place: Where it stands.
        instead: What it ends with, by what its child ended with, where that is another status.
        words: What it says then; ``{}`` stands for what its child says.
    """

    def __init__(
        self, place: NodePlace, instead: dict[int, int] | None = None, words: dict[int, str] | None = None
    ) -> None:
        super().__init__(place)
        self.instead, self.words = instead or {}, words or {}

    def tick(self, rows: Array) -> None:
        """On to the child."""
        self.tick_child(0, rows)

    def after(self, child: int, rows: Array, status: Array) -> None:
        """Back with the status."""
        found = status
        for said, meant in self.instead.items():
            found = self.xp.where(status == said, self.xp.full_like(status, meant), found)
        self.end(rows, found)

    def says(self, row: int) -> Statement | None:
        """Its words where it has changed a status, else those of its child."""
        if not self.words:
            return None
        said = self.batch.reasons.said_by(self.place.children[0], row)
        below = said.sentence if said is not None else ""
        words = self.words.get(int(self.place.child_status[0][row]))
        if words is None:
            return TEXT(text=below) if below else None
        return TEXT(text=words.format(f" [{below}]" if below else ""))
