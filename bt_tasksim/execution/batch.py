"""One tree in many worlds: compiled to arrays and ticked in all of them at once.

Each world means, tick by tick, what py_trees' nodes mean: the same leaves are ticked and stopped in the same
order, and all nodes have the same statuses. A world that ticks stands at one node at a time. All worlds that
have come to the same node are taken together, and of several nodes the one that a tick visits first.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.context import Context
from bt_tasksim.core.batch_leaf import FAILURE, INVALID, PENDING, RUNNING, BatchLeaf
from bt_tasksim.core.errors import BtTasksimError, InputError, LeafError
from bt_tasksim.core.outcomes import Outcome
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.batch_reasons import BatchReasons
from bt_tasksim.execution.leaf_errors import is_leafs, leaf_error
from bt_tasksim.execution.world_by_world import BelowUnknown, Copies, Watcher, WorldByWorld
from bt_tasksim.trees.check import check_tree
from bt_tasksim.trees.nodes.base import NodeKind
from bt_tasksim.trees.nodes.batch import Arrays, BatchNode, NodePlace
from bt_tasksim.trees.nodes.subtree import SubTree
from bt_tasksim.trees.nodes.subtree import compiled as compiled_subtree
from bt_tasksim.trees.vocabulary import node_kinds
from bt_tasksim.trees.walk import nodes_of, preorder


class BatchTree:
    """A tree that is ticked in many worlds at once.

    Nodes are numbered as `trees.walk` has them: parents before their children, these from left to right.
    Worlds are rows: integer arrays ``(k,)`` of different numbers below ``worlds``. Each begins and ends by
    itself.

    Args:
        tree: The tree's root. Nothing is changed in it.
        worlds: How many, N.
        leaves: What a leaf is in a batch; None where it does not know the leaf.
        build: Makes one more tree of the same shape. What neither ``leaves`` nor the kinds of nodes know
            (see `NodeKind.compiled`) is ticked by py_trees, world by world, in a copy for each world; a
            warning says so, once for each class. Without it a single world has the tree's own nodes there,
            which whoever ticks it has set up.
        contexts: The context of a world, which such nodes are set up with.
        xp: The library of all arrays, such as ``numpy`` or ``torch``.
        device: One of the library's devices; None: its default.

    Attributes:
        nodes: The nodes of the tree, by number.
        compiled: By number: the node in a batch, or the leaf; for nodes below one that is ticked world by
            world, what tells of them.
        waits_at: ``(N,)`` the leaf before which a world's tick stands still, by number, or -1.

    Raises:
        InputError: The tree is refused (see `check_tree`), there are no worlds, or something in the tree is
            not known in several worlds and there is no ``build``, or what that makes is another tree.
    """

    def __init__(
        self,
        tree: Behaviour,
        worlds: int,
        leaves: Callable[[Behaviour], BatchLeaf | None],
        *,
        build: Callable[[], Behaviour] | None = None,
        contexts: Callable[[int], Context] | None = None,
        xp: Any = np,
        device: Any = None,
    ) -> None:
        check_tree(tree)
        if worlds < 1:
            raise InputError(f"a batch holds one world at least, found {worlds}")
        self.arrays = Arrays(worlds, xp, device)
        self.xp = self.arrays.xp
        self.nodes = nodes_of(tree)
        self._status = self.arrays.full(INVALID, "int8", len(self.nodes))
        self._status_of = [self._status[n] for n in range(len(self.nodes))]
        self.now = self.arrays.full(0.0, "float64")
        """``(N,)`` seconds since each world's episode began, at its last tick."""
        self.waits_at = self.arrays.full(-1, "int32")
        self._waiting = 0
        self._here, self._said = self.arrays.full(False, "bool"), self.arrays.full(INVALID, "int8")
        self._due: list[int] = []
        self._inbox: dict[int, list[tuple[Array, ...]]] = {}
        self._handlers: list[Callable[..., None]] = []
        self._enter, self._leave = [0] * len(self.nodes), [0] * len(self.nodes)
        self._resume: dict[int, int] = {}
        self._listeners: dict[int, tuple[int, Callable[[Array], None]]] = {}
        self._watchers: dict[int, Watcher] = {}
        self._at: tuple[int, Array] | None = None
        children, self._ends = _shape(tree)
        self.compiled: dict[int, BatchNode | BatchLeaf] = {}
        self._copies = Copies(tree, worlds, build, contexts)
        self._compile(children, leaves, self._copies)
        self.reasons = BatchReasons(self.nodes, children, self.compiled, self._status_of)
        self.unknown = {n: c for n, c in self.compiled.items() if isinstance(c, WorldByWorld)}
        """What py_trees ticks, world by world, by number."""

    @property
    def status(self) -> Array:
        """Statuses ``(N, nodes)``, numbered as in `bt_tasksim.core.batch_leaf`; a view, not to be written."""
        return self._status.T

    def tick(self, rows: Array, now: Array | float) -> Array:
        """One tick in some worlds.

        Args:
            rows: ``(k,)`` the worlds.
            now: ``(k,)``, or one for all: seconds since each world's episode began.

        Returns:
            ``(k,)`` statuses of the root; PENDING in worlds whose tick stands still before a leaf: `resume`
            goes on.

        Raises:
            ValueError: The last tick of one of them still stands before a leaf.
        """
        if self._waiting and self.arrays.count(self.waits_at[rows] >= 0):
            raise ValueError("the last tick of a world has not ended: it waits before a leaf; resume it")
        self.now[rows] = now
        return self._run(rows, {self._enter[0]: rows})

    def resume(self, rows: Array) -> Array:
        """Go on with ticks that stand still before a leaf.

        Args:
            rows: ``(k,)`` the worlds.

        Returns:
            ``(k,)`` as of `tick`.

        Raises:
            ValueError: One of them does not wait.
        """
        at = self.waits_at[rows]
        if self.arrays.count(at < 0):
            raise ValueError("there is a world whose tick waits before no leaf: tick it")
        groups = list(self.arrays.groups(at, rows))
        self.waits_at[rows] = -1
        self._waiting -= len(rows)
        return self._run(rows, {self._resume[node]: there for node, there in groups})

    def reset(self, rows: Array) -> None:
        """End all nodes in worlds that begin anew, as the root's ``stop(INVALID)``.

        Ticks that stand still are dropped, and all their nodes end, also those that py_trees would forget.
        What a behaviour raises as it is ended changes nothing any more.
        """
        if not len(rows):
            return
        if self._waiting:
            at = self.waits_at[rows]
            waiting = self.arrays.where(at >= 0)
            for node, there in self.arrays.groups(at[waiting], rows[waiting]):
                with suppress(LeafError):
                    self._leaf(node).stop(there)
                self._status_of[node][there] = INVALID
                self.waits_at[there] = -1
                self._waiting -= len(there)
        ended = False
        while not ended:
            with suppress(LeafError):  # the node that raised has ended: the others are next
                self.stop_node(0, rows)
                ended = True

    def renew(self, rows: Array) -> None:
        """Give worlds that begin anew new copies of what py_trees ticks: such nodes may remember things.

        A single world that has the tree's own nodes keeps them. Each world has a new blackboard.
        """
        for row in rows.tolist() if self.unknown else ():
            for number, copy in self._copies.renewed(row).items():
                self.unknown[number].renew(row, copy)

    def watch(self, node: int, callback: Watcher) -> None:
        """Be told whenever a node ends its tick in some worlds.

        Of several watched nodes, those that a world's tick visits first are told first.

        Args:
            node: The node, by number.
            callback: Takes worlds ``(k,)`` and the statuses ``(k,)`` that the node has there now. Gives
                booleans ``(k,)``, or None for all: where the tick goes on. Elsewhere it is broken off where
                it stands, and `reset` comes next. Below a node that is ticked world by world it goes on in
                any case.
        """
        found = self.compiled[node]
        if isinstance(found, BelowUnknown):
            found.above.watchers[found.position] = callback
            return
        self._watchers[node] = callback

    def speaker(self, row: int) -> Behaviour | None:
        """The node that made the tree fail in a world: the one that was decided last, with words to say."""
        found = self.reasons.speaker(0, row)
        return None if found is None else self.nodes[found]

    def outcome(self, row: int) -> Outcome | None:
        """Why the tree failed in a world, with what was tried before; None where nobody says it.

        To be asked before the world begins anew.
        """
        found = self.reasons.speaker(0, row)
        return None if found is None else self.reasons.whole_outcome(found, row)

    def tick_node(self, node: int, rows: Array) -> None:
        """Let worlds tick a node next; for nodes, see `trees.nodes.batch.Batch`."""
        self._send(self._enter[node], (rows,))

    def end_node(self, node: int, rows: Array, status: Array) -> None:
        """A node ends its tick; for nodes, see `trees.nodes.batch.Batch`."""
        if self.unknown:
            invalid = self.arrays.where(status == INVALID)
            if len(invalid):
                self.stop_node(node, rows[invalid])
        self._status_of[node][rows] = status
        if node in self._watchers:
            rows, status = self._watched(node, rows, status)
            if not len(rows):
                return
        self._send(self._leave[node], (rows, status))

    def _watched(self, node: int, rows: Array, status: Array) -> tuple[Array, Array]:
        """The worlds in which a tick goes on after a watched node has ended, and its statuses there."""
        going = self._watchers[node](rows, status)
        if going is None:
            return rows, status
        on = self.arrays.where(going)
        return rows[on], status[on]

    def stop_node(self, node: int, rows: Array) -> None:
        """Stop a node and all below it; for nodes, see `trees.nodes.batch.Batch`."""
        if self._ends[node] == node + 1:
            self._end(node, rows, self._status_of[node][rows])
            return
        block = self.xp.take(self._status[node : self._ends[node]], rows, axis=1)
        for below in self.arrays.where(self.xp.any(block != INVALID, axis=1)).tolist():
            self._end(node + below, rows, block[below])

    def acting(self, node: int, rows: Array) -> Array:
        """A leaf, at or below a node, is RUNNING; for nodes, see `trees.nodes.batch.Batch`."""
        found = self.xp.zeros_like(rows, dtype=self.xp.bool)
        for below in range(node, self._ends[node]):
            if self._ends[below] == below + 1:
                found = found | (self._status_of[below][rows] == RUNNING)
        return found

    def _end(self, node: int, rows: Array, status: Array) -> None:
        most, listener = self._listeners.get(node, (INVALID, None))
        if listener is not None:
            heard = self.arrays.where((status != INVALID) & (status <= most))
            if len(heard):
                try:
                    listener(rows[heard])
                finally:
                    self._status_of[node][rows] = INVALID
        self._status_of[node][rows] = INVALID

    def _send(self, event: int, parcel: tuple[Array, ...]) -> None:
        if event in self._inbox:
            self._inbox[event].append(parcel)
        else:
            self._inbox[event] = [parcel]
            heapq.heappush(self._due, event)

    def _run(self, rows: Array, first: dict[int, Array]) -> Array:
        try:
            for event, there in first.items():
                self._send(event, self._merged([(there,)]))
            while self._due:
                event = heapq.heappop(self._due)
                parcels = self._inbox.pop(event)
                self._handlers[event](*(parcels[0] if len(parcels) == 1 else self._merged(parcels)))
        except BaseException as error:
            self._give_up(rows)
            if self._at is None or isinstance(error, BtTasksimError) or not is_leafs(error):
                raise
            raise leaf_error(error, self.nodes[self._at[0]]) from error
        finally:
            self._at = None
        status = self._status_of[0][rows]
        if self._waiting:
            status[self.waits_at[rows] >= 0] = PENDING
        return status

    def _merged(self, parcels: list[tuple[Array, ...]]) -> tuple[Array, ...]:
        """Rows, and the statuses that come with them, of several parcels as one; rows ascend."""
        for rows, *status in parcels:
            self._here[rows] = True
            if status:
                self._said[rows] = status[0]
        rows = self.arrays.where(self._here)
        self._here[rows] = False
        return (rows, self._said[rows]) if len(parcels[0]) > 1 else (rows,)

    def _give_up(self, rows: Array) -> None:
        """End all nodes in the worlds of a tick in which a leaf raised, that leaf too."""
        self._due.clear()
        self._inbox.clear()
        if self._at is not None:
            node, there = self._at
            with suppress(LeafError):  # one error is told
                self._leaf(node).stop(there)
            self._status_of[node][there] = INVALID
        self.reset(rows)

    def _leaf(self, node: int) -> BatchLeaf:
        leaf = self.compiled[node]
        assert isinstance(leaf, BatchLeaf)
        return leaf

    def _tick_leaf(self, node: int, leaf: BatchLeaf, rows: Array) -> None:
        self._at = node, rows
        self._took(node, rows, leaf.tick(rows, self._status_of[node][rows] != RUNNING))

    def _resume_leaf(self, node: int, leaf: BatchLeaf, rows: Array) -> None:
        self._at = node, rows
        self._took(node, rows, leaf.resume(rows))

    def _took(self, node: int, rows: Array, status: Array) -> None:
        self._at = None
        pending = status == PENDING
        if self.arrays.count(pending):
            waiting = rows[self.arrays.where(pending)]
            self.waits_at[waiting] = node
            self._waiting += len(waiting)
            on = self.arrays.where(~pending)
            rows, status = rows[on], status[on]
            if not len(rows):
                return
        self._status_of[node][rows] = status
        if node in self._watchers:
            rows, status = self._watched(node, rows, status)
            if not len(rows):
                return
        self._handlers[self._leave[node]](rows, status)

    def _compile(
        self,
        children: list[tuple[int, ...]],
        leaves: Callable[[Behaviour], BatchLeaf | None],
        copies: Copies,
    ) -> None:
        """Number what happens in a tick in the order in which it visits nodes, on the way down and up."""
        kinds = list(node_kinds().values())
        steps: list[tuple[int, int | None, int]] = [(0, None, 0)]
        while steps:
            node, parent, which = steps.pop()
            if node < 0:
                self._leave[~node] = len(self._handlers)
                self._handlers.append(self._after(parent, which))
                continue
            self._enter[node] = len(self._handlers)
            steps.append((~node, parent, which))
            found = self._known(node, children[node], kinds)
            if found is not None:
                self._handlers.append(found.tick)
                if type(found).stopped is not BatchNode.stopped:
                    self._listeners[node] = RUNNING, found.stopped
                steps.extend((c, node, k) for k, c in reversed(list(enumerate(children[node]))))
                self.compiled[node] = found
                continue
            leaf = None if children[node] else leaves(self.nodes[node])
            if leaf is None:
                block = self._status[node : self._ends[node]]
                leaf = WorldByWorld(copies.of(node, self.nodes[node]), block, self.arrays, copies.boards)
                for below in range(node + 1, self._ends[node]):
                    self.compiled[below] = BelowUnknown(leaf, below - node)
            self.compiled[node] = leaf
            self._listeners[node] = FAILURE if leaf.stops_ended else RUNNING, leaf.stop
            self._handlers.append(partial(self._tick_leaf, node, leaf))
            self._resume[node] = len(self._handlers)
            self._handlers.append(partial(self._resume_leaf, node, leaf))

    def _known(self, node: int, children: tuple[int, ...], kinds: list[NodeKind[Any]]) -> BatchNode | None:
        behaviour = self.nodes[node]
        below = tuple(self._status_of[c] for c in children)
        place = NodePlace(self, node, self._status_of[node], children, below)
        if type(behaviour) is SubTree:
            return compiled_subtree(behaviour, place)
        kind = next((kind for kind in kinds if kind.describes(behaviour)), None)
        return None if kind is None else kind.compiled(behaviour, place)

    def _after(self, parent: int | None, which: int) -> Callable[[Array, Array], None]:
        if parent is None:
            return lambda rows, status: None
        above = self.compiled[parent]
        assert isinstance(above, BatchNode)
        return partial(above.after, which)


def _shape(tree: Behaviour) -> tuple[list[tuple[int, ...]], list[int]]:
    """By number of a node: the numbers of its children, and the first number behind all that is below it."""
    children: list[list[int]] = []
    ends: list[int] = []
    path: list[int] = []
    for node, (depth, _) in enumerate(preorder(tree)):
        for left in path[depth:]:
            ends[left] = node
        del path[depth:]
        if path:
            children[path[-1]].append(node)
        path.append(node)
        children.append([])
        ends.append(0)
    for left in path:
        ends[left] = len(children)
    return [tuple(below) for below in children], ends
