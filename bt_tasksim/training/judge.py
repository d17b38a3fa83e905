"""What follows a Train node, watched in many worlds at once: how it ends, and what the hidden state says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.activation import Activation
from bt_tasksim.concept.batch_leaves import ConceptInBatch
from bt_tasksim.concept.context import Context
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.seen import Known
from bt_tasksim.concept.status import STATUSES
from bt_tasksim.core.batch_leaf import FAILURE, RUNNING, SUCCESS
from bt_tasksim.core.bundles import taken
from bt_tasksim.core.outcomes import OUT_OF_REACH, Outcome, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.units import COUNT
from bt_tasksim.core.world import Hidden
from bt_tasksim.execution.batch import BatchTree
from bt_tasksim.scene.success import DEEPEST, penetration
from bt_tasksim.trees.nodes.train import Train, concepts_in, follower_of
from bt_tasksim.trees.walk import nodes_of

NEVER = -1

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
    """Takes note of nodes that end their ticks, until what follows a Train node has ended.

    Args:
        train: The Train node.
        tree: The tree.
        context: The tree's; it knows the hidden state, or nobody does.

    Attributes:
        train: The Train node, by number.
        follower: What judges it, by number; None: nothing follows.
        scope: The sequence in which that follows.
        tolerance: ``(N,)`` sufficient cost below which a goal counts as reached.
    """

    def __init__(self, train: Train, tree: BatchTree, context: Context) -> None:
        self._tree, self._context = tree, context
        numbers = {id(node): number for number, node in enumerate(tree.nodes)}
        found = follower_of(train)
        self.train = numbers[id(train)]
        self.follower = None if found is None else numbers[id(found[0])]
        self.scope = None if found is None else numbers[id(found[1])]
        judging: Behaviour = train if found is None else found[0]
        leaves = [numbers[id(leaf)] for leaf in concepts_in(judging)]
        self._leaves = {number: _Judged(_leaf_of(tree, number), context.worlds) for number in leaves}
        self.tolerance: Array = np.ones(context.worlds)
        self._cost: Array = np.zeros(context.worlds)
        self._missed: dict[int, Outcome] = {}

    @property
    def nodes(self) -> list[int]:
        """The nodes that are to be watched."""
        ends = [node for node in (self.follower, self.scope) if node is not None]
        return sorted({self.train, *ends, *self._leaves})

    def reset(self, rows: Array) -> None:
        """Begin episodes in worlds ``(k,)``."""
        for judged in self._leaves.values():
            judged.before[rows] = judged.activation.activations[rows]
            judged.began[rows] = NEVER
        self._cost[rows] = 0.0
        for row in rows.tolist():
            self._missed.pop(row, None)

    def saw(self, node: int, rows: Array, status: Array) -> None:
        """Take note of a node that has ended its tick in worlds ``(k,)`` with statuses ``(k,)``."""
        judged = self._leaves.get(node)
        if judged is None:
            return
        now = judged.activation.activations[rows]
        known = (judged.began[rows] != NEVER) | (now != judged.before[rows])
        fresh = known & (judged.began[rows] != now)
        if fresh.any():
            begins = rows[fresh]
            hidden = self._context.ask_hidden(begins)
            judged.began[begins] = now[fresh]
            for k, row in enumerate(begins.tolist()):
                judged.hidden[row] = None if hidden is None else taken(hidden, np.array([k]))
        done = known & (status == SUCCESS)
        if done.any():
            self._charge(node, judged, rows[done])

    def ended(self, node: int, rows: Array) -> dict[int, SignalOutcome]:
        """The outcomes, where there are any, of a node that has just ended its tick in worlds ``(k,)``."""
        tree = self._tree
        if node == self.follower:
            ends = rows[tree.status[rows, node] > RUNNING]
            return {row: self.by(node, row) for row in ends.tolist()}
        return self.unreached(rows) if node == self.scope else {}

    def unreached(self, rows: Array) -> dict[int, SignalOutcome]:
        """The outcomes in worlds ``(k,)`` whose sequence has ended, and not by what follows."""
        assert self.scope is not None and self.follower is not None
        out = {}
        scope, follower = self._tree.nodes[self.scope].name, self._tree.nodes[self.follower].name
        for row in rows[self._tree.status[rows, self.scope] != RUNNING].tolist():
            why = self._failed(self.scope, row) or FOLLOWER_NOT_REACHED(ended=scope, follower=follower)
            out[row] = SignalOutcome(False, self._status(self.follower, row), why)
        return out

    def by(self, node: int, row: int) -> SignalOutcome:
        """The outcome in a world, where a node judges that has ended there."""
        name = self._tree.nodes[node].name
        status = "" if self.follower is None else self._status(node, row)
        if self._tree.status[row, node] == FAILURE:
            outcome = self._failed(node, row) or FOLLOWER_FAILED(node=name)
            return SignalOutcome(False, status, outcome, discarded=outcome.is_a(OUT_OF_REACH))
        hidden, cost = self._context.ask_hidden(np.array([row])), float(self._cost[row])
        if cost >= self.tolerance[row]:
            missed = self._missed.get(row, GOAL_MISSED(leaf="", cost=0.0))
            return SignalOutcome(False, status, missed, cost=cost)
        depth = 0.0 if hidden is None else float(hidden.penetration[0])
        if depth > DEEPEST:
            return SignalOutcome(False, status, penetration(depth), cost=cost)
        return SignalOutcome(True, status, FOLLOWED(node=name), cost=cost)

    def _charge(self, node: int, judged: _Judged, rows: Array) -> None:
        """Take in the sufficient costs of a leaf that has succeeded in worlds ``(k,)``."""
        hidden = self._context.ask_hidden(rows)
        if hidden is None:
            return
        model, memory = judged.leaf.model, judged.activation.memory
        facts = self._context.seen(rows, np.zeros(len(rows))).world
        for k, row in enumerate(rows.tolist()):
            one = np.array([k])

            def one_of(values: Array, one: Array = one) -> Array:
                return values[one]

            now, began = (
                None if state is None else self._context.in_columns(state, np.array([row]))
                for state in (taken(hidden, one), judged.hidden.get(row))
            )
            assert now is not None, "it was asked for above"
            known = Known(now, facts.map(one_of), began)
            cost = float(model.sufficient_cost(known, taken(memory, np.array([row])))[0])
            if cost >= self._cost[row] and cost > 0.0:
                self._cost[row] = cost
                self._missed[row] = GOAL_MISSED(leaf=self._tree.nodes[node].name, cost=cost)

    def _failed(self, root: int, row: int) -> Outcome | None:
        """What the first failed leaf of a subtree says, or the subtree itself."""
        tree = self._tree
        below = range(root, root + len(nodes_of(tree.nodes[root])))
        for number in below:
            if tree.nodes[number].children or tree.status[row, number] != FAILURE:
                continue
            said = tree.reasons.outcome_of(number, row)
            if said is not None:
                return FOLLOWER_FAILED(said, node=tree.nodes[number].name)
        said = tree.reasons.outcome_of(root, row)
        return None if said is None else FOLLOWER_FAILED(said, node=tree.nodes[root].name)

    def _status(self, node: int, row: int) -> str:
        return STATUSES[int(self._tree.status[row, node])].name


class _Judged:
    """A leaf whose goal counts.

    Attributes:
        leaf: It, in the tree.
        activation: Its activations there.
        before: ``(N,)`` how often it had begun when the episode did.
        began: ``(N,)`` the activation whose beginning was seen; `NEVER` without one.
        hidden: The hidden state ``(1, ...)`` then, by world, its objects in the world's own order: names may
            come to have other columns until it is looked at.
    """

    def __init__(self, leaf: tuple[ConceptNode, Activation], worlds: int) -> None:
        self.leaf, self.activation = leaf
        self.before: Array = np.zeros(worlds, np.int64)
        self.began: Array = np.full(worlds, NEVER, np.int64)
        self.hidden: dict[int, Hidden | None] = {}


def _leaf_of(tree: BatchTree, number: int) -> tuple[ConceptNode, Activation]:
    """A concept's leaf, by number, and how it runs in the worlds."""
    found, leaf = tree.compiled[number], tree.nodes[number]
    assert isinstance(leaf, ConceptNode)
    # Below a node that py_trees ticks there is one world, and the leaf is that of its tree.
    return leaf, found.activation if isinstance(found, ConceptInBatch) else leaf.activation
