"""What follows a Train node, watched: how it ends, and what the hidden state says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept import ConceptModel
from bt_tasksim.context import Context, Known
from bt_tasksim.judge import DEEPEST
from bt_tasksim.training.decorator import Train, concepts_in, follower_of
from bt_tasksim.world import Hidden


@dataclass(frozen=True)
class Outcome:
    """What became of a completion signal.

    Attributes:
        success: Status and hidden state agree that it was right.
        status: The follower's status; empty without a follower.
        why: One sentence.
        discarded: An error of engine or kinematics spoiled the judgement.
        cost: Largest sufficient cost of what succeeded, in units of what is tolerable.
    """

    success: bool
    status: str
    why: str
    discarded: bool = False
    cost: float = 0.0


class Judgement:
    """Watches the nodes that a tree's ticks visit, until what follows a Train node has ended.

    Args:
        train: The Train node.
        context: The tree's context.
        tolerance: Sufficient cost below which a goal counts as reached.
    """

    def __init__(self, train: Train, context: Context, tolerance: float = 1.0) -> None:
        found = follower_of(train)
        self.follower: Behaviour | None = found[0] if found else None
        self.scope: Behaviour | None = found[1] if found else None
        self._train, self._context, self.tolerance = train, context, tolerance
        self._judged = set(concepts_in(self.follower if self.follower is not None else train))
        self._began: dict[ConceptModel, tuple[int, Hidden | None]] = {}
        self._activations: dict[ConceptModel, int] = {}
        self._cost, self._why = 0.0, ""
        self.reset()

    def reset(self) -> None:
        """Begin an episode."""
        self._began.clear()
        self._activations = {leaf: leaf.activations for leaf in self._judged}
        self._cost, self._why = 0.0, ""

    def saw(self, node: Any) -> None:
        """Take note of a node that a tick has visited."""
        if not isinstance(node, ConceptModel) or node not in self._judged:
            return
        began = self._began.get(node)
        if began is None and node.activations == self._activations[node]:
            return
        if began is None or began[0] != node.activations:
            self._began[node] = began = (node.activations, self._context.hidden())
        if node.status == Status.SUCCESS:
            hidden = self._context.hidden()
            if hidden is None:
                return
            known = Known(hidden, self._context.world, began[1])
            cost = float(node.sufficient_cost(known, node.memory))
            if cost >= self._cost and cost > 0.0:
                self._cost, self._why = (
                    cost,
                    f"{node.name} ended SUCCESS, and its goal is missed by {cost:.2g}",
                )

    def ended(self, node: Any = None) -> Outcome | None:
        """The outcome, once there is one.

        Args:
            node: What a tick has just visited; None at a tick's end. The other nodes' statuses may be those
                of earlier ticks.
        """
        follower, scope = self.follower, self.scope
        if follower is None:
            return self._outcome(self._train)
        if node is follower and follower.status in (Status.SUCCESS, Status.FAILURE):
            return self._outcome(follower)
        if scope is not None and (node is None or node is scope) and scope.status != Status.RUNNING:
            why = _why(scope) or f"'{scope.name}' ended before '{follower.name}' did"
            return Outcome(False, follower.status.name, why)
        return None

    def _outcome(self, node: Behaviour) -> Outcome:
        name = "" if self.follower is None else node.status.name
        hidden = self._context.hidden()
        if node.status == Status.FAILURE:
            why = _why(node)
            return Outcome(False, name, why, discarded="out of reach" in why)
        if self._cost >= self.tolerance:
            return Outcome(False, name, self._why, cost=self._cost)
        if hidden is not None and float(hidden.penetration) > DEEPEST:
            depth = 1000 * float(hidden.penetration)
            return Outcome(False, name, f"two bodies overlapped by {depth:.1f} mm", cost=self._cost)
        return Outcome(True, name, f"{node.name} succeeded", cost=self._cost)


def _why(root: Behaviour) -> str:
    """The reason of the leaf that failed below a node."""
    leaf = next(
        (n for n in root.iterate() if n.status == Status.FAILURE and not n.children and n.feedback_message),
        None,
    )
    return f"{leaf.name}: {leaf.feedback_message}" if leaf is not None else root.feedback_message
