"""What a batch of trees does not know, as one leaf of it: py_trees ticks a copy for each world."""

from __future__ import annotations

import logging
from collections.abc import Callable, Generator
from typing import Any, NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.context import Context
from bt_tasksim.concept.leaf import Decision
from bt_tasksim.concept.reporting import outcome_of, speaker
from bt_tasksim.core.batch_leaf import FAILURE, INVALID, PENDING, RUNNING, SUCCESS, BatchLeaf
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import Outcome
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.leaf_errors import end_all
from bt_tasksim.trees.nodes.batch import Arrays
from bt_tasksim.trees.walk import nodes_of

LOG = logging.getLogger(__name__)

CODES = {
    Status.INVALID: INVALID,
    Status.RUNNING: RUNNING,
    Status.SUCCESS: SUCCESS,
    Status.FAILURE: FAILURE,
}


class Suspended(NamedTuple):
    """A tick that stands still before a leaf under training."""

    ticks: Generator[Behaviour | Decision, None, None]
    decision: Decision


class WorldByWorld(BatchLeaf):
    """A behaviour, with all below it, that py_trees ticks in one world after the other.

    Args:
        copies: The behaviour of each world.
        status: ``(nodes, N)`` where the statuses of the behaviour and of those below it are shown.
        arrays: The arrays of the batch.

    Attributes:
        suspended: By world, where its tick stands still before a leaf under training.
    """

    def __init__(self, copies: list[Behaviour], status: Array, arrays: Arrays) -> None:
        self.copies, self.arrays = copies, arrays
        self._status = status
        self._nodes = [nodes_of(copy) for copy in copies]
        self.suspended: dict[int, Suspended] = {}

    def tick(self, rows: Array, fresh: Array) -> Array:
        """See `BatchLeaf.tick`."""
        return self._codes([self._go_on(row, _ticks(self.copies[row])) for row in rows.tolist()])

    def resume(self, rows: Array) -> Array:
        """See `BatchLeaf.resume`."""
        return self._codes([self._go_on(row, self.suspended.pop(row).ticks) for row in rows.tolist()])

    def stop(self, rows: Array) -> None:
        """See `BatchLeaf.stop`; called too where it has ended, as py_trees does."""
        for row in rows.tolist():
            half = self.suspended.pop(row, None)
            if half is not None:
                half.ticks.close()
                end_all(self.copies[row], half.decision.leaf)
            self.copies[row].stop(Status.INVALID)

    def outcome(self, row: int) -> Outcome | None:
        """See `BatchLeaf.outcome`: what the node says that was decided last."""
        found = speaker(self.copies[row])
        return None if found is None else outcome_of(found)

    def _go_on(self, row: int, ticks: Generator[Behaviour | Decision, None, None]) -> int:
        for said in ticks:
            if isinstance(said, Decision):
                self.suspended[row] = Suspended(ticks, said)
                return PENDING
        codes = [CODES[node.status] for node in self._nodes[row]]
        if len(codes) > 1:
            self._status[:, row] = self._codes(codes)
        return codes[0]

    def _codes(self, codes: list[int]) -> Array:
        return self.arrays.xp.asarray(codes, dtype=self.arrays.xp.int8, device=self.arrays.device)


def _shape(node: Behaviour) -> tuple[str, str, int]:
    kind = type(node)
    return kind.__module__, kind.__qualname__, len(node.children)


def _ticks(copy: Behaviour) -> Generator[Behaviour | Decision, None, None]:
    yield from copy.tick()


class Copies:
    """A tree for each world, made when something of it is asked for.

    Args:
        tree: What the copies should be like.
        worlds: How many.
        build: Makes one; None: there are none.
        contexts: The context of a world; None: nodes are set up without one.
    """

    def __init__(
        self,
        tree: Behaviour,
        worlds: int,
        build: Callable[[], Behaviour] | None,
        contexts: Callable[[int], Context] | None,
    ) -> None:
        self._tree, self._worlds, self._build, self._contexts = tree, worlds, build, contexts
        self._nodes: list[list[Behaviour]] = []
        self._known: dict[int, Context] = {}
        self._said: set[type[Behaviour]] = set()

    def of(self, number: int, node: Behaviour) -> list[Behaviour]:
        """A node of each copy, set up with all below it; says once for each class that it is not known.

        Args:
            number: Its number in the order of `trees.walk`.
            node: It, in the tree itself.

        Raises:
            InputError: No copies can be made, or they are other trees.
        """
        kind = type(node)
        if self._build is None:
            raise InputError(
                f"'{node.name}' cannot be ticked in a batch: {kind.__name__} has no form for many worlds; "
                f"give build=..., which makes the tree, so that each world gets one of its own"
            )
        if kind not in self._said:
            self._said.add(kind)
            LOG.warning(
                "%s has no form for many worlds: '%s' is ticked world by world", kind.__name__, node.name
            )
        if not self._nodes:
            self._nodes = [self._copy(self._build) for _ in range(self._worlds)]
        found = [nodes[number] for nodes in self._nodes]
        for world, copy in enumerate(found):
            self._set_up(copy, world)
        return found

    def _copy(self, build: Callable[[], Behaviour]) -> list[Behaviour]:
        copy = build()
        if copy is self._tree or any(copy is nodes[0] for nodes in self._nodes):
            raise InputError("build=... gives the same tree again: it should make a new one at each call")
        nodes, wanted = nodes_of(copy), nodes_of(self._tree)
        if [_shape(n) for n in nodes] != [_shape(n) for n in wanted]:
            raise InputError(
                f"build=... makes another tree than '{self._tree.name}': the classes of its nodes differ"
            )
        return nodes

    def _set_up(self, copy: Behaviour, world: int) -> None:
        arguments: dict[str, Any] = {}
        if self._contexts is not None:
            if world not in self._known:
                self._known[world] = self._contexts(world)
            arguments["context"] = self._known[world]
        for node in copy.iterate():
            node.setup(**arguments)
