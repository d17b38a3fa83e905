"""Why a tree ended as it did in one world of a batch: made from the arrays when somebody asks.

Each function is what one of the same name says of a tree of py_trees, see `bt_tasksim.concept.reporting`
and `bt_tasksim.trees.nodes.pass_through`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from py_trees.behaviour import Behaviour

from bt_tasksim.concept.reporting import Reporting, as_statement, outcome_of
from bt_tasksim.core.batch_leaf import FAILURE, INVALID, BatchLeaf
from bt_tasksim.core.outcomes import FAILED, Outcome, Statement
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
        self._nodes, self._children, self._compiled, self._status = nodes, children, compiled, status
        self._parents = {child: node for node, below in enumerate(children) for child in below}

    def name(self, node: int) -> str:
        """A node's name."""
        return self._nodes[node].name

    def tip(self, node: int, row: int) -> int | None:
        """The deepest node that was decided last, at or below a node; None where it is not active."""
        while True:
            found = self._compiled[node]
            if isinstance(found, WorldByWorld | BelowUnknown):
                below = found.tip(row)
                return None if below is None else node + below
            current = found.current(row) if isinstance(found, BatchNode) else None
            if current is None:
                return node if int(self._status[node][row]) != INVALID else None
            node = self._children[node][current]

    def outcome_of(self, node: int, row: int) -> Outcome | None:
        """What a node says itself; words of one that has failed are `FAILED`."""
        ticked = self._ticked(node, row)
        if ticked is not None:
            return outcome_of(ticked)
        said = self._says(node, row)
        if said is None or isinstance(said, Outcome):
            return said
        words = said.sentence
        return FAILED(text=words) if words and int(self._status[node][row]) == FAILURE else None

    def said_by(self, node: int, row: int) -> Statement | None:
        """What a node says itself."""
        outcome = self.outcome_of(node, row)
        ticked = self._ticked(node, row)
        if ticked is not None:
            return outcome or as_statement(ticked.feedback_message)
        said = self._says(node, row) if outcome is None else None
        return outcome if said is None else as_statement(said.sentence)

    def said_below(self, node: int, row: int) -> Statement | None:
        """What the deepest node says that has something to say."""
        tip = self.tip(node, row)
        return (self.said_by(tip, row) if tip is not None else None) or self.said_by(node, row)

    def speaker(self, node: int, row: int) -> int | None:
        """The node, at or below one that has failed, that made it fail: decided last, with words to say."""
        found = self.tip(node, row)
        if found is not None and self._has_words(found, row):
            return found
        ahead = [node]
        while ahead:
            below = ahead.pop()
            if int(self._status[below][row]) == FAILURE and self._has_words(below, row):
                return below
            ahead.extend(self._children[below])
        return found

    def whole_outcome(self, node: int, row: int) -> Outcome | None:
        """What a node that has failed says, with what the nodes above it have to add."""
        outcome = self.outcome_of(node, row)
        while outcome is not None and node in self._parents:
            node = self._parents[node]
            above, ticked = self._compiled[node], self._ticked(node, row)
            if isinstance(above, BatchNode):
                outcome = above.adds(row, outcome)
            elif isinstance(ticked, Reporting):
                outcome = ticked.seen_from_here(outcome)
        return outcome

    def _says(self, node: int, row: int) -> Statement | None:
        found = self._compiled[node]
        return found.says(row) if isinstance(found, BatchNode) else found.outcome(row)

    def _ticked(self, node: int, row: int) -> Behaviour | None:
        """The node itself, where py_trees ticks it in this world."""
        found = self._compiled[node]
        return found.behaviour(row) if isinstance(found, WorldByWorld | BelowUnknown) else None

    def _has_words(self, node: int, row: int) -> bool:
        ticked = self._ticked(node, row)
        if ticked is not None:
            return bool(ticked.feedback_message)
        said = self._says(node, row)
        return said is not None and bool(said.sentence)
