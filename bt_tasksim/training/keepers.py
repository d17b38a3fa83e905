"""What each process of a training keeps: a batch of worlds, of one where there is no form for many.

A process that is forked has the tree. An actor of a cluster builds its own, and sees that it is the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from py_trees.behaviour import Behaviour

from bt_tasksim.concept.context import Context
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.identity import differing
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.policy.policy import Policy
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.training.episode_batch import EpisodeBatch
from bt_tasksim.training.learning_leaves import find_train
from bt_tasksim.training.learning_tree import in_training
from bt_tasksim.training.named_tree import NamedTree
from bt_tasksim.training.reward import Reward
from bt_tasksim.training.subject import evaluation_subject, own_code
from bt_tasksim.trees.nodes.train import concepts_in


@dataclass(frozen=True)
class Keeping:
    """What a process keeps, but for tree and scene.

    Attributes:
        train: Name of the `Train` node.
        options: Engines.
        reward: What is paid.
        policies: Policies of other leaves, by the leaf's name: what was trained before.
        worlds: How many worlds it has.
    """

    train: str
    options: EngineOptions
    reward: Reward
    policies: Mapping[str, Policy]
    worlds: int

    def keeper(
        self, tree: Behaviour, scene: WorldSource, build: Callable[[], Behaviour] | None
    ) -> EpisodeBatch:
        """It, made; ``build`` makes one more tree, see `EpisodeBatch`."""
        about = tree, scene, self.train, self.options, self.reward
        return EpisodeBatch(*about, policies=self.policies, worlds=self.worlds, build=build)

    def subject(self, tree: Behaviour, scene: WorldSource, source: NamedTree) -> dict[str, str]:
        """What it is of, as hashes by name, once the tree is set up."""
        learners = find_train(tree, self.train).learners()
        policies = {
            leaf.name: "" if leaf.lacks_policy else leaf.policy_in_use.name
            for leaf in concepts_in(tree)
            if leaf not in learners
        }
        code = own_code(tree, source.tree, source.plugins)
        return evaluation_subject(tree, scene, self.options, policies, code, "training")


@dataclass(frozen=True)
class KeeperElsewhere:
    """Makes what an actor keeps; it is pickled.

    Attributes:
        keeping: What it keeps.
        source: Where it finds tree and scene.
        subject: What these must be.
    """

    keeping: Keeping
    source: NamedTree
    subject: Mapping[str, str]

    @classmethod
    def of(cls, keeping: Keeping, source: NamedTree, tree: Behaviour, scene: WorldSource) -> KeeperElsewhere:
        """The same as of this process, with its tree and scene."""
        learners = find_train(tree, keeping.train).learners()
        with in_training(tree, learners, Context(load_robot(scene.robot)), keeping.policies):
            return cls(keeping, source, keeping.subject(tree, scene, source))

    def __call__(self) -> EpisodeBatch:
        """Make it.

        Raises:
            InputError: What is found there is no good, or is not what it is here.
        """
        found = self.source.load(self.keeping.options)
        keeper = self.keeping.keeper(found.build(), found.scene, found.build)
        subject = self.keeping.subject(keeper.tree, keeper.scene, self.source)
        known = {name: hashed for name, hashed in subject.items() if name in self.subject}
        if others := differing(self.subject, known):  # who sent this may have no file of the tree
            raise InputError(
                f"another {others} is found there by the name '{self.source.tree}': "
                "have the same files everywhere"
            )
        return keeper
