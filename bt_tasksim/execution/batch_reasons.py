"""Why a tree ended as it did in one world of a batch: made from the arrays when somebody asks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from py_trees.behaviour import Behaviour

from bt_tasksim.concept.reporting import BEHAVIOURS, Sayings
from bt_tasksim.core.batch_leaf import FAILURE, INVALID, BatchLeaf
from bt_tasksim.core.outcomes import Outcome, Statement
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.world_by_world import BelowUnknown, WorldByWorld
from bt_tasksim.trees.nodes.batch import BatchNode


class BatchReasons:
    """What the nodes of a batch say.

    Args:
        nodes: The tree's nodes by number.
        children: Numbers of their children.
        compiled: What they are in the batch.
        status: ``(N,)`` their statuses.
    """

    def __init__(
        self,
        nodes: Sequence[Behaviour],
        children: Sequence[tuple[int, ...]],
        compiled: Mapping[int, BatchNode | BatchLeaf],
        status: Sequence[Array],
    ) -> None:
        self.nodes, self.children, self.compiled, self.status = nodes, children, compiled, status
        self.parents = {child: node for node, below in enumerate(children) for child in below}

    def name(self, node: int) -> str:
        """A node's name."""
        return self.nodes[node].name

    def tip(self, node: int, row: int) -> int | None:
        """See `Sayings.tip`."""
        return WorldSayings(self, row).tip(node)

    def outcome_of(self, node: int, row: int) -> Outcome | None:
        """See `Sayings.outcome_of`."""
        return WorldSayings(self, row).outcome_of(node)

    def said_by(self, node: int, row: int) -> Statement | None:
        """See `Sayings.said_by`."""
        return WorldSayings(self, row).said_by(node)

    def said_below(self, node: int, row: int) -> Statement | None:
        """See `Sayings.said_below`."""
        return WorldSayings(self, row).said_below(node)

    def speaker(self, node: int, row: int) -> int | None:
        """See `Sayings.speaker`."""
        return WorldSayings(self, row).speaker(node)

    def whole_outcome(self, node: int, row: int) -> Outcome | None:
        """See `Sayings.whole_outcome`."""
        return WorldSayings(self, row).whole_outcome(node)


class WorldSayings(Sayings[int]):
    """What nodes say in one world of a batch.

    Args:
        batch: Of all worlds.
        row: Which world.
    """

    def __init__(self, batch: BatchReasons, row: int) -> None:
        self._batch, self._row = batch, row

    def tip(self, node: int) -> int | None:
        """See `Sayings.tip`."""
        batch, row = self._batch, self._row
        while True:
            found = batch.compiled[node]
            if isinstance(found, WorldByWorld | BelowUnknown):
                below = found.tip(row)
                return None if below is None else node + below
            current = found.current(row) if isinstance(found, BatchNode) else None
            if current is None:
                return node if int(batch.status[node][row]) != INVALID else None
            node = batch.children[node][current]

    def failed(self, node: int) -> bool:
        """See `Sayings.failed`."""
        return int(self._batch.status[node][self._row]) == FAILURE

    def says(self, node: int) -> Statement | None:
        """See `Sayings.says`."""
        found, ticked = self._batch.compiled[node], self._ticked(node)
        if ticked is not None:
            return BEHAVIOURS.says(ticked)
        return found.says(self._row) if isinstance(found, BatchNode) else found.outcome(self._row)

    def below(self, node: int) -> Sequence[int]:
        """See `Sayings.below`."""
        return self._batch.children[node]

    def above(self, node: int) -> int | None:
        """See `Sayings.above`."""
        return self._batch.parents.get(node)

    def adds(self, node: int, outcome: Outcome) -> Outcome:
        """See `Sayings.adds`."""
        found, ticked = self._batch.compiled[node], self._ticked(node)
        if ticked is not None:
            return BEHAVIOURS.adds(ticked, outcome)
        return found.adds(self._row, outcome) if isinstance(found, BatchNode) else outcome

    def _ticked(self, node: int) -> Behaviour | None:
        """The node itself, where py_trees ticks it in this world."""
        found = self._batch.compiled[node]
        return found.behaviour(self._row) if isinstance(found, WorldByWorld | BelowUnknown) else None
