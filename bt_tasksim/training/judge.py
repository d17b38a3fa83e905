"""What follows a Train node, watched: how it ends, and what the hidden state says."""

from __future__ import annotations

from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.context import Context
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.reporting import outcome_of
from bt_tasksim.concept.seen import Known
from bt_tasksim.core.outcomes import OUT_OF_REACH, Outcome, register_reason
from bt_tasksim.core.units import COUNT
from bt_tasksim.core.world import Hidden
from bt_tasksim.scene.success import DEEPEST, PENETRATION
from bt_tasksim.trees.nodes.train import Train, concepts_in, follower_of

FOLLOWED = register_reason("followed", "{node} succeeded")
FOLLOWER_FAILED = register_reason("follower_failed", "{node}")
GOAL_MISSED = register_reason(
    "goal_missed", "{leaf} ended SUCCESS, and its goal is missed by {cost:.2g}", cost=COUNT
)
FOLLOWER_NOT_REACHED = register_reason("follower_not_reached", "'{ended}' ended before '{follower}' did")


@dataclass(frozen=True)
class SignalOutcome:
    """What became of a completion signal.

    Attributes:
        success: Status and hidden state agree that it was right.
        status: The follower's status; empty without a follower.
        outcome: Why.
        discarded: An error of engine or kinematics spoiled the judgement.
        cost: Largest sufficient cost of what succeeded, in units of what is tolerable.
    """

    success: bool
    status: str
    outcome: Outcome
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
        self._began: dict[ConceptNode, tuple[int, Hidden | None]] = {}
        self._activations: dict[ConceptNode, int] = {}
        self.reset()

    def reset(self) -> None:
        """Begin an episode."""
        self._began.clear()
        self._activations = {leaf: leaf.activations for leaf in self._judged}
        self._cost, self._missed = 0.0, GOAL_MISSED(leaf="", cost=0.0)

    def saw(self, node: Behaviour | None) -> None:
        """Take note of a node that a tick has visited."""
        if not isinstance(node, ConceptNode) or node not in self._judged:
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
            cost = float(node.model.sufficient_cost(known, node.memory)[0])
            if cost >= self._cost and cost > 0.0:
                self._cost, self._missed = cost, GOAL_MISSED(leaf=node.name, cost=cost)

    def ended(self, node: Behaviour | None = None) -> SignalOutcome | None:
        """The outcome, once there is one.

        Args:
            node: What a tick has just visited; None at a tick's end. The other nodes' statuses may be those
                of earlier ticks.
        """
        follower, scope = self.follower, self.scope
        if follower is None:
            return self._judged_by(self._train)
        if node is follower and follower.status in (Status.SUCCESS, Status.FAILURE):
            return self._judged_by(follower)
        if scope is not None and (node is None or node is scope) and scope.status != Status.RUNNING:
            unreached = FOLLOWER_NOT_REACHED(ended=scope.name, follower=follower.name)
            return SignalOutcome(False, follower.status.name, _failed(scope) or unreached)
        return None

    def _judged_by(self, node: Behaviour) -> SignalOutcome:
        status = "" if self.follower is None else node.status.name
        if node.status == Status.FAILURE:
            return judged_failed(node.name, status, _failed(node))
        hidden = self._context.hidden()
        depth = None if hidden is None else float(hidden.penetration[0])
        missed = self._missed if self._cost >= self.tolerance else None
        return judged_done(node.name, status, self._cost, missed, depth)


def judged_failed(node: str, status: str, why: Outcome | None) -> SignalOutcome:
    """What judges a completion signal has failed: the signal was wrong, or nobody can say.

    Args:
        node: Its name.
        status: Its status; empty where nothing follows.
        why: What it says; None where it says nothing.
    """
    outcome = why or FOLLOWER_FAILED(node=node)
    return SignalOutcome(False, status, outcome, discarded=outcome.is_a(OUT_OF_REACH))


def judged_done(
    node: str, status: str, cost: float, missed: Outcome | None, depth: float | None
) -> SignalOutcome:
    """What judges a completion signal has succeeded: the hidden state has the last word.

    Args:
        node: Its name.
        status: Its status; empty where nothing follows.
        cost: Largest sufficient cost of what succeeded.
        missed: The goal that was missed by more than is tolerable; None: none was.
        depth: Deepest overlap of two bodies, metres; None where nobody knows it.
    """
    if missed is not None:
        return SignalOutcome(False, status, missed, cost=cost)
    if depth is not None and depth > DEEPEST:
        return SignalOutcome(False, status, PENETRATION(depth=depth), cost=cost)
    return SignalOutcome(True, status, FOLLOWED(node=node), cost=cost)


def _failed(root: Behaviour) -> Outcome | None:
    """What the last failed leaf of a subtree says, or the subtree itself."""
    leaf = next(
        (n for n in root.iterate() if n.status == Status.FAILURE and not n.children and n.feedback_message),
        root,
    )
    said = outcome_of(leaf)
    return None if said is None else FOLLOWER_FAILED(said, node=leaf.name)
