"""A tree in many worlds whose ticks stand still wherever a leaf that is to learn is about to act."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import NamedTuple

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.batch_leaves import ConceptInBatch, leaf_in_batch
from bt_tasksim.concept.context import Context
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.world_context import WorldContext
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import Outcome
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.batch import BatchTree
from bt_tasksim.execution.leaf_errors import set_up
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.world_by_world import BelowUnknown
from bt_tasksim.execution.worlds import why_alone
from bt_tasksim.policy.policy import Action, Policy
from bt_tasksim.robot.description import RobotDescription, load_robot
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.training.decision import Decision
from bt_tasksim.training.learning_leaves import find_train, shared_layout, spaces_of
from bt_tasksim.trees.check import check_tree
from bt_tasksim.trees.nodes.train import BatchTrain, concepts_in


@contextmanager
def in_training(
    tree: Behaviour, learners: Sequence[ConceptNode], context: Context, policies: Mapping[str, Policy]
) -> Iterator[None]:
    """A tree that is set up for training, within the block; afterwards it can be run again.

    Args:
        tree: The tree.
        learners: The leaves that somebody else decides for.
        context: What it is set up with.
        policies: Policies of other leaves, by the leaf's name.
    """
    leaves = concepts_in(tree)
    try:
        for leaf in leaves:
            leaf.under_training = leaf in learners
        set_up(tree, context=context)
        for leaf in leaves:
            if leaf.name in policies and leaf not in learners:
                leaf.use(policies[leaf.name])
        yield
    finally:
        for leaf in leaves:
            leaf.under_training = False


def why_alone_in(
    tree: Behaviour, scene: WorldSource, options: EngineOptions, build: Callable[[], Behaviour] | None
) -> str:
    """Why episodes of a tree run one by one, as a sentence; empty where they need not."""
    alone = why_alone(options)
    if alone or build is not None:
        return alone
    context = Context(load_robot(scene.robot), worlds=2)
    try:
        BatchTree(tree, context.worlds, lambda leaf: leaf_in_batch(leaf, context))
    except InputError:
        return "something in the tree has no form for many worlds, and there is no build="
    return ""


class Waiting(NamedTuple):
    """Worlds ``(k,)`` that wait before a leaf.

    Attributes:
        rows: Which.
        decisions: What the leaf sees and remembers in each.
        features: The same as a policy sees it ``(k, n)``, float32.
        costs: Necessary cost in each.
    """

    rows: list[int]
    decisions: list[Decision]
    features: Array
    costs: list[float]


class LearningTree:
    """A tree with a `Train` node, set up for training until it is closed.

    Args:
        tree: The tree.
        robot: The robot.
        train: Name of the `Train` node; by default the first one.
        policies: Policies of other leaves, by the leaf's name.
        worlds: How many, N.
        build: Makes one more tree of the same shape, see `bt_tasksim.execution.batch.BatchTree`.

    Attributes:
        train: The `Train` node.
        learners: The leaves under it that learn.
        layout: Sizes of the parts of what they see, by name.
        observation_space: What they see.
        action_space: What is decided.
        context: The context of all leaves.
        batch: The tree in the worlds.

    Raises:
        InputError: There is no `Train` node, nothing under it can learn, or the leaves that learn differ in
            what they see or do; what is to learn stands below a behaviour that is not known; or there are to
            be several worlds, and something in the tree has no form for that, and there is no ``build``.
    """

    def __init__(
        self,
        tree: Behaviour,
        robot: RobotDescription,
        train: str | None,
        policies: Mapping[str, Policy],
        worlds: int,
        build: Callable[[], Behaviour] | None,
    ) -> None:
        check_tree(tree)
        self.train = find_train(tree, train)
        self.learners = self.train.learners()
        self.context = Context(robot, worlds)
        with ExitStack() as stack:
            stack.enter_context(in_training(tree, self.learners, self.context, policies))
            self.layout = shared_layout(self.train, self.learners, robot)
            self.observation_space, self.action_space = spaces_of(self.layout, self.learners[0].model.actions)
            self.batch = BatchTree(
                tree,
                worlds,
                lambda leaf: leaf_in_batch(leaf, self.context),
                build=build,
                contexts=partial(WorldContext, self.context),
            )
            self._numbers = {id(node): number for number, node in enumerate(self.batch.nodes)}
            self._check_known()
            self._open = stack.pop_all()

    def close(self) -> None:
        """The tree can be run again."""
        self._open.close()

    def activations(self, rows: Array) -> Array:
        """How often the `Train` node has begun in worlds ``(k,)``."""
        compiled = self.batch.compiled[self._numbers[id(self.train)]]
        assert isinstance(compiled, BatchTrain)
        return compiled.activations[rows]

    def waiting(self, rows: Array) -> Iterator[Waiting]:
        """Worlds ``(k,)`` that wait for decisions, by the leaf before which they do.

        Raises:
            InputError: A leaf's features are not what it says.
        """
        for number, there in self.batch.arrays.groups(self.batch.waits_at[rows], rows):
            leaf = self._leaf(number)
            judged = leaf.waiting(there)
            model, seen, memory = leaf.leaf.model, judged.seen, judged.memory
            features = np.asarray(model.features(seen, memory), np.float32)
            if features.shape != (len(there), *self.observation_space.shape):
                raise InputError(
                    f"'{leaf.leaf.name}': features() gives {features.shape[1:]}, layout() says "
                    f"{self.observation_space.shape}"
                )
            decisions = [Decision(leaf.leaf, seen, memory, k) for k in range(len(there))]
            costs = np.asarray(model.necessary_cost(seen, memory), float).tolist()
            yield Waiting(there.tolist(), decisions, features, costs)

    def decide(self, rows: Array, action: Action) -> None:
        """Say what is to be done ``(k, ...)`` in worlds ``(k,)`` that wait for it."""
        leaves = self.batch.waits_at[rows]
        for number in set(leaves.tolist()):
            there = np.flatnonzero(leaves == number)
            self._leaf(number).decide(rows[there], Action(action.motion[there], action.terminate[there]))

    def outcome(self, leaf: ConceptNode, row: int) -> Outcome | None:
        """How a leaf that learns has ended in a world; None where it runs, or says nothing."""
        return self._leaf(self._numbers[id(leaf)]).outcome(row)

    def _leaf(self, number: int) -> ConceptInBatch:
        leaf = self.batch.compiled[number]
        assert isinstance(leaf, ConceptInBatch)
        return leaf

    def _check_known(self) -> None:
        """Refuse what is to learn where py_trees ticks it, which waits for nobody."""
        for node in (self.train, *self.learners):
            found = self.batch.compiled[self._numbers[id(node)]]
            if isinstance(found, BelowUnknown):
                above = found.above.node(0, 0)
                raise InputError(
                    f"'{node.name}' cannot be trained below '{above.name}': {type(above).__name__} has no "
                    f"form that waits for decisions; give it one, see `compiled` in docs/parts/tree_node.md"
                )
