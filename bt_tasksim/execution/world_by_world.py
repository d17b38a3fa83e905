"""What a batch of trees does not know, as one leaf of it: py_trees ticks a copy for each world."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.context import Context
from bt_tasksim.concept.reporting import outcome_of
from bt_tasksim.core.batch_leaf import FAILURE, INVALID, RUNNING, SUCCESS, BatchLeaf
from bt_tasksim.core.errors import BtTasksimError, InputError
from bt_tasksim.core.outcomes import Outcome
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.blackboard import WorldBlackboard
from bt_tasksim.execution.leaf_errors import set_up, stop, ticking
from bt_tasksim.trees.nodes.batch import Arrays
from bt_tasksim.trees.walk import nodes_of

LOG = logging.getLogger(__name__)

CODES = {
    Status.INVALID: INVALID,
    Status.RUNNING: RUNNING,
    Status.SUCCESS: SUCCESS,
    Status.FAILURE: FAILURE,
}


Watcher = Callable[[Array, Array], Array | None]
"""Is told worlds ``(k,)`` and a node's statuses ``(k,)`` there, see `BatchTree.watch`."""


class WorldByWorld(BatchLeaf):
    """A behaviour, with all below it, that py_trees ticks in one world after the other.

    Args:
        copies: The behaviour of each world.
        status: ``(nodes, N)`` where the statuses of the behaviour and of those below it are shown.
        arrays: The arrays of the batch.
        boards: The blackboard of each world, on which it is ticked; they change as worlds begin anew.

    Attributes:
        watchers: Who is told of a node below when it ends its tick, by its position in the order of
            `trees.walk`, from the behaviour on.
    """

    stops_ended = True

    def __init__(
        self,
        copies: list[Behaviour],
        status: Array,
        arrays: Arrays,
        boards: Sequence[WorldBlackboard],
    ) -> None:
        self.copies, self.arrays, self._boards = copies, arrays, boards
        self._status = status
        self._nodes = [nodes_of(copy) for copy in copies]
        self.watchers: dict[int, Watcher] = {}

    def tick(self, rows: Array, fresh: Array) -> Array:
        """See `BatchLeaf.tick`."""
        return self._codes([self._tick(row) for row in rows.tolist()])

    def stop(self, rows: Array) -> None:
        """See `BatchLeaf.stop`.

        Raises:
            LeafError: A behaviour raised as it was ended; those of all worlds have ended.
        """
        wrong: list[BtTasksimError] = []
        for row in rows.tolist():
            with self._boards[row]:
                try:
                    stop(self.copies[row])
                except BtTasksimError as error:
                    wrong.append(error)
        if wrong:
            raise wrong[0]

    def outcome(self, row: int) -> Outcome | None:
        """See `BatchLeaf.outcome`."""
        return outcome_of(self.copies[row])

    def behaviour(self, row: int) -> Behaviour:
        """The behaviour of a world."""
        return self.copies[row]

    def tip(self, row: int, position: int = 0) -> int | None:
        """The deepest node below one that was decided last in a world, as so many positions further on."""
        nodes = self._nodes[row]
        found = nodes[position].tip()
        return next((k - position for k, node in enumerate(nodes) if node is found), None)

    def renew(self, row: int, copy: Behaviour) -> None:
        """Another copy for a world that begins anew."""
        self.copies[row], self._nodes[row] = copy, nodes_of(copy)

    def node(self, row: int, position: int) -> Behaviour:
        """A node of a world's copy, by its position in the order of `trees.walk`, the behaviour's being 0."""
        return self._nodes[row][position]

    def _tick(self, row: int) -> int:
        """One tick in a world; the behaviour's status."""
        nodes = self._nodes[row]
        watched = {id(nodes[k]): told for k, told in self.watchers.items()}
        with self._boards[row]:
            for node in ticking(self.copies[row]):
                if id(node) in watched:
                    watched[id(node)](np.array([row]), self._codes([CODES[node.status]]))
        codes = [CODES[node.status] for node in nodes]
        if len(codes) > 1:
            self._status[:, row] = self._codes(codes)
        return codes[0]

    def _codes(self, codes: list[int]) -> Array:
        return self.arrays.xp.asarray(codes, dtype=self.arrays.xp.int8, device=self.arrays.device)


class BelowUnknown(BatchLeaf):
    """A node below one that is ticked world by world: others can ask what it says; py_trees ticks it.

    Args:
        above: What is ticked world by world.
        position: Its position below that, in the order of `trees.walk`.

    Attributes:
        above: See there.
        position: See there.
    """

    def __init__(self, above: WorldByWorld, position: int) -> None:
        self.above, self.position = above, position

    def tick(self, rows: Array, fresh: Array) -> Array:
        """See `BatchLeaf.tick`: never called."""
        raise NotImplementedError("the node is ticked by what stands above it")

    def outcome(self, row: int) -> Outcome | None:
        """See `BatchLeaf.outcome`."""
        return outcome_of(self.behaviour(row))

    def behaviour(self, row: int) -> Behaviour:
        """The node in a world."""
        return self.above.node(row, self.position)

    def tip(self, row: int) -> int | None:
        """See `WorldByWorld.tip`."""
        return self.above.tip(row, self.position)


def _shape(node: Behaviour) -> tuple[str, str, int]:
    kind = type(node)
    return kind.__module__, kind.__qualname__, len(node.children)


class Copies:
    """A tree for each world, made when something of it is asked for.

    Args:
        tree: What the copies should be like.
        worlds: How many.
        build: Makes one; None: there are none, and a single world has the tree itself, set up by its owner.
        contexts: The context of a world; None: nodes are set up without one.

    Attributes:
        boards: The blackboard of each world: its tree was made, set up and is ticked on it.
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
        self.boards = [WorldBlackboard() for _ in range(worlds)]
        self._known: dict[int, Context] = {}
        self._said: set[type[Behaviour]] = set()
        self._used: list[int] = []

    def of(self, number: int, node: Behaviour) -> list[Behaviour]:
        """A node of each copy, set up with all below it; says once for each class that it is not known.

        Args:
            number: Its number in the order of `trees.walk`.
            node: It, in the tree itself.

        Raises:
            InputError: No copies can be made, or they are other trees.
        """
        kind = type(node)
        if self._build is None and self._worlds == 1:
            return [node]
        if self._build is None:
            raise InputError(
                f"'{node.name}' cannot be ticked in a batch: {kind.__name__} has no form for many worlds; "
                f"run it in one world, or give build=..., a function that makes a tree for each world"
            )
        if kind not in self._said:
            self._said.add(kind)
            LOG.warning(
                "%s has no form for many worlds: '%s' is ticked world by world", kind.__name__, node.name
            )
        if not self._nodes:
            for world in range(self._worlds):
                self._nodes.append(self._copy(self._build, world))
        self._used.append(number)
        found = [nodes[number] for nodes in self._nodes]
        for world, copy in enumerate(found):
            self._set_up(copy, world)
        return found

    def renewed(self, world: int) -> dict[int, Behaviour]:
        """A new copy of one world, whose nodes remember nothing: those that were asked for, by number.

        Its blackboard is a new one in any case.
        """
        self.boards[world] = WorldBlackboard()
        if self._build is None or not self._nodes:
            return {}
        nodes = self._nodes[world] = self._copy(self._build, world)
        for number in self._used:
            self._set_up(nodes[number], world)
        return {number: nodes[number] for number in self._used}

    def _copy(self, build: Callable[[], Behaviour], world: int) -> list[Behaviour]:
        with self.boards[world]:
            copy = build()
        if copy is self._tree or any(copy is nodes[0] for nodes in self._nodes):
            raise InputError("build() gives the same tree again: it should make a new one at each call")
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
        with self.boards[world]:
            set_up(copy, **arguments)
