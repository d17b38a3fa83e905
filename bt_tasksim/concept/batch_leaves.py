"""Concepts and conditions as leaves of a tree that is ticked in many worlds at once."""

from __future__ import annotations

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.activation import Activation, Judged, no_action
from bt_tasksim.concept.condition import ConditionNode, answer
from bt_tasksim.concept.context import Context
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.core.batch_leaf import FAILURE, PENDING, RUNNING, SUCCESS, BatchLeaf
from bt_tasksim.core.outcomes import Outcome, Statement
from bt_tasksim.core.poses import Array, array_namespace, host
from bt_tasksim.core.transfer import Index
from bt_tasksim.policy.policy import Action


class ConceptInBatch(BatchLeaf):
    """A concept in all worlds of a batch.

    Args:
        leaf: The concept's leaf in the tree, set up: its policy decides. Under training the ticks of worlds
            in which a decision is due are PENDING, until `decide` has been told it.
        context: The batch's.
    """

    stops_ended = True

    def __init__(self, leaf: ConceptNode, context: Context) -> None:
        self.leaf = leaf
        self.activation = Activation(leaf, leaf.model, context)
        like, worlds = context.like, context.worlds
        xp = array_namespace(like)
        self._motion: Array = xp.zeros((worlds, leaf.model.actions), dtype=like.dtype, device=like.device)
        self._terminate: Array = xp.zeros((worlds,), dtype=like.dtype, device=like.device)
        self._due: Judged | None = None

    def tick(self, rows: Array, fresh: Array) -> Array:
        """See `BatchLeaf.tick`."""
        activation, leaf = self.activation, self.leaf
        judged = activation.judge(rows, fresh)
        if not len(judged.rows):
            return judged.statuses
        if not leaf.under_training:
            return activation.act(judged, leaf.decision(judged))
        due = host(leaf.model.decides(judged.seen, judged.memory))
        if not due.all():
            free = judged.at(np.flatnonzero(~due))
            activation.act(free, leaf.amended(no_action(free, leaf.model.actions), free.memory))
        judged.statuses[judged.going[due]] = PENDING
        self._due = judged.at(np.flatnonzero(due))
        return judged.statuses

    def waiting(self, rows: Array) -> Judged:
        """What is seen and remembered in worlds ``rows (k,)`` whose ticks are PENDING before this leaf."""
        due = self._due
        if due is None or not np.array_equal(due.rows, rows):
            due = self.activation.going_on(rows)  # they have come to wait in several ticks
        k = len(rows)
        return due._replace(statuses=np.full(k, RUNNING, np.int8), going=np.arange(k))

    def decide(self, rows: Array, action: Action) -> None:
        """Say what is to be done in worlds ``rows (k,)`` whose ticks are PENDING before this leaf.

        The action may be NumPy's wherever concepts are computed.
        """
        xp, index = array_namespace(self._motion), Index(rows)
        for whole, new in ((self._motion, action.motion), (self._terminate, action.terminate)):
            index.put(whole, xp.asarray(new, dtype=whole.dtype, device=whole.device))

    def resume(self, rows: Array) -> Array:
        """See `BatchLeaf.resume`."""
        judged, index = self.waiting(rows), Index(rows)
        action = Action(index.of(self._motion), index.of(self._terminate))
        return self.activation.act(judged, self.leaf.amended(action, judged.memory))

    def stop(self, rows: Array) -> None:
        """See `BatchLeaf.stop`."""
        self.activation.stopped(rows)

    def outcome(self, row: int) -> Outcome | None:
        """How it ended when it was last active in a world; None where it runs."""
        return self.activation.outcomes.get(row)


class ConditionInBatch(BatchLeaf):
    """A condition in all worlds of a batch.

    Args:
        leaf: The condition's leaf in the tree.
        context: The batch's.
    """

    def __init__(self, leaf: ConditionNode, context: Context) -> None:
        self._leaf, self._context = leaf, context
        self._answers: dict[int, tuple[Statement | None, int, bool]] = {}

    def tick(self, rows: Array, fresh: Array) -> Array:
        """See `BatchLeaf.tick`."""
        found, why = self._leaf.asked(self._context.seen(rows, np.zeros(len(rows))))
        holds = host(found)
        each = enumerate(zip(rows.tolist(), holds.tolist(), strict=True))
        self._answers.update((row, (why, k, yes)) for k, (row, yes) in each)
        return np.where(holds, SUCCESS, FAILURE).astype(np.int8)

    def outcome(self, row: int) -> Outcome | None:
        """The last answer in a world."""
        return answer(*self._answers[row]) if row in self._answers else None


def leaf_in_batch(leaf: Behaviour, context: Context) -> BatchLeaf | None:
    """What a leaf of a tree is in a batch; None for one that is neither a concept nor a condition."""
    if isinstance(leaf, ConceptNode):
        return ConceptInBatch(leaf, context)
    return ConditionInBatch(leaf, context) if isinstance(leaf, ConditionNode) else None
