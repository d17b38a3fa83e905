"""An activation of a subtree under `Train` as an episode of reinforcement learning (`gymnasium.Env`)."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

import gymnasium
import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.leaf import ConceptNode, Decision
from bt_tasksim.concept.reporting import speaker
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.renamed import renamed_arguments
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import LONGEST, Runner
from bt_tasksim.policy.policy import Action, Policy, split_action
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.training.episodes import Episode
from bt_tasksim.training.reward import Reward
from bt_tasksim.training.reward_parts import Decided
from bt_tasksim.training.transitions import Transitions
from bt_tasksim.trees.nodes.train import Train, concepts_in, train_nodes

REDRAWS = 50
"""Draws in a row in which the subtree may stay inactive."""
CAMERA = "overview"


class EpisodeEnv(gymnasium.Env[Array, Array]):
    """One activation of what stands under a `Train` node, as an episode.

    ``reset`` draws a world and ticks the tree until a leaf under training is about to act; ``step`` gives it
    an action and goes on to its next decision. Earlier siblings run first; once the subtree says SUCCESS,
    what follows it runs to its end within that same ``step`` and pays the sufficient reward.

    An action holds the concept's motion in [-1, 1] and, last, the completion signal: above
    `bt_tasksim.policy.policy.TERMINATE` the task is done, and the motion counts for nothing.

    ``info`` of a step: ``reward`` (its parts by name, see `Reward`); and of an episode's last one:
    ``is_success``, ``status`` (of the subtree), ``follower`` (status of what follows), ``reason`` (the name
    of a reason), ``why`` (its sentence), ``discarded`` (the judgement was spoiled: ``truncated`` and no
    sufficient reward) and ``seconds``.

    Args:
        tree: The tree, with one `Train` node at least.
        scene: The scene.
        train: Name of the `Train` node; by default the first one.
        options: Engines; by default SAPIEN with the noise model ``original``.
        reward: What is paid.
        stream: Stream of draws, see `bt_tasksim.scene.configuration.STREAMS`.
        stage: Number of the scene's stage that worlds are drawn from; None: the scene itself.
        longest: Seconds of an episode, earlier siblings included, after which it is truncated.
        render_mode: ``rgb_array``, or None.
        policies: Policies of other leaves, by the leaf's name: what was trained before.

    Raises:
        InputError: There is no `Train` node, nothing under it can learn, or the leaves that learn differ in
            what they see or do.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}

    @renamed_arguments(lesson="stage")
    def __init__(
        self,
        tree: Behaviour,
        scene: WorldSource,
        train: str | None = None,
        options: EngineOptions | None = None,
        reward: Reward | None = None,
        stream: str = "training",
        stage: int | None = None,
        longest: float = LONGEST,
        render_mode: str | None = None,
        policies: Mapping[str, Policy] | None = None,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise InputError(f"render_mode should be 'rgb_array' or None, found {render_mode!r}")
        options = options or EngineOptions(noise="original", rendering=render_mode is not None)
        self.train = find_train(tree, train)
        self.learners = self.train.learners()
        for leaf in concepts_in(tree):
            leaf.under_training = leaf in self.learners
        self.runner = Runner(tree, scene, options, longest=longest)
        for leaf in concepts_in(tree):
            if policies and leaf.name in policies and leaf not in self.learners:
                leaf.use(policies[leaf.name])
        self.tree, self.scene = tree, self.runner.scene
        self.reward = reward or Reward()
        self.stream, self.stage, self.render_mode = stream, stage, render_mode
        self.layout = shared_layout(self.train, self.learners, self.runner.robot)
        m = self.learners[0].model.actions
        self.observation_space, self.action_space = spaces_of(self.layout, m)
        self._action_shape = (m + 1,)
        self.redrawn = 0
        """Draws so far in which the subtree was never active."""
        self.discarded = 0
        """Episodes so far whose judgement an error spoiled."""
        self._episode: Episode | None = None
        self._transitions: Transitions | None = None

    @property
    def decision(self) -> Decision | None:
        """What the leaf under training sees and remembers while its action is waited for; else None."""
        return None if self._episode is None else self._episode.waiting

    # ---- gymnasium --------------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Draw worlds until the subtree is about to act in one.

        Args:
            seed: Seed of the draws to come.
            options: ``draw``: the seed of this very world, instead of a random one.

        Raises:
            InputError: In many draws in a row the tree ended without activating the subtree.
        """
        super().reset(seed=seed)
        given = None if options is None else options.get("draw")
        redrawn = 0
        while True:
            draw = int(self.np_random.integers(2**31)) if given is None else int(given)
            decision = self._begin(draw)
            if decision is not None:
                break
            redrawn += 1
            if redrawn >= REDRAWS or given is not None:
                leaf = speaker(self.tree)
                why = leaf.feedback_message if leaf is not None else ""
                raise not_reached(self.train.name, redrawn, draw, self.tree.status.name, why)
        self.redrawn += redrawn
        self._transitions = Transitions(decision, self.reward.gamma)
        return self._features(decision), {"draw": draw, "redrawn": redrawn}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Give the leaf its action ``(actions + 1,)`` and go on to its next decision or the episode's end.

        Raises:
            InputError: The action has the wrong shape or is not finite.
            RuntimeError: There is no episode.
        """
        action = np.asarray(action, np.float64)
        if action.shape != self._action_shape or not isfinite(action @ action):
            raise InputError(f"an action should be {self._action_shape[0]} finite numbers, found {action}")
        return self.act(split_action(action[None]))

    def act(self, action: Action) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """`step` with what a policy decides: a programmed one may ask for more than an action's bounds allow.

        Raises:
            RuntimeError: There is no episode.
        """
        episode, transitions, decision = self._episode, self._transitions, self.decision
        if episode is None or transitions is None or decision is None:
            raise RuntimeError("step() without an episode: call reset() first")
        decision.leaf.decide(action)
        transitions.decided(action.motion[0])
        found = episode.next_decision()
        if found is None:
            return self._end(episode, transitions)
        parts = self.reward.pay(transitions.to(found))
        return self._features(found), sum(parts.values()), False, False, {"reward": parts}

    def render(self) -> Array | None:
        """The picture ``(height, width, 3)`` of a camera beside the robot, uint8."""
        if self.render_mode is None:
            return None
        return self.runner.pipeline.render(CAMERA).colour

    def close(self) -> None:
        """Let go of engines; the tree can be run again."""
        self._drop()
        for leaf in self.learners:
            leaf.under_training = False
        self.runner.pipeline.close()

    # ---- the episode ------------------------------------------------------------------------------------

    def _begin(self, draw: int) -> Decision | None:
        """The first decision in the world of a draw; None where the tree ends without one."""
        self._drop()
        world = self.scene.sample(draw, self.stream, self.stage)
        self._episode = Episode(self.runner, self.train, world)
        return self._episode.next_decision()

    def _end(
        self, episode: Episode, transitions: Transitions
    ) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """The last step of an episode: what is paid, and why."""
        ending = episode.ending(self.reward.sufficient)
        parts = self.reward.pay(transitions.to_end(ending.end, ending.kept))
        self.discarded += ending.discarded
        info = ending.info(parts)
        features = self._features(transitions.decision)
        self._drop()
        return features, sum(parts.values()), not ending.truncated, ending.truncated, info

    def _drop(self) -> None:
        """End the episode where it is."""
        if self._episode is not None:
            self._episode.close()
            self._episode = self._transitions = None

    def _features(self, decision: Decided) -> Array:
        """What the leaf sees."""
        model = decision.leaf.model
        found = np.asarray(model.features(decision.seen, decision.memory)[0], np.float32)
        if found.shape != self.observation_space.shape:
            raise InputError(
                f"'{decision.leaf.name}': features() gives {found.shape}, layout() says "
                f"{self.observation_space.shape}"
            )
        return found


def not_reached(train: str, redrawn: int, draw: int, status: str, why: str) -> InputError:
    """Says that a Train node was never active.

    Args:
        train: Its name.
        redrawn: In how many draws.
        draw: The last one.
        status: Status of the tree at the end of that.
        why: What the tree says.
    """
    return InputError(
        f"'{train}' was not reached in {redrawn} draws; the last one (seed {draw}) ended with {status}: {why}"
    )


def spaces_of(layout: Mapping[str, int], actions: int) -> tuple[gymnasium.spaces.Box, gymnasium.spaces.Box]:
    """What is observed, and what is decided: a motion, and last the completion signal.

    Args:
        layout: Sizes of the parts of the features, by name.
        actions: Size of the motion.
    """
    return (
        gymnasium.spaces.Box(-np.inf, np.inf, (sum(layout.values()),), np.float32),
        gymnasium.spaces.Box(-1.0, 1.0, (actions + 1,), np.float32),
    )


def find_train(tree: Behaviour, name: str | None = None) -> Train:
    """The Train node of a name, or the first one.

    Raises:
        InputError: There is none.
    """
    found = train_nodes(tree)
    if not found:
        raise InputError(f"tree '{tree.name}' has no Train(...) node: mark what is to be learned")
    for node in found:
        if name is None or node.name == name:
            return node
    raise InputError(f"no Train node '{name}' in the tree; there is {', '.join(repr(n.name) for n in found)}")


def shared_layout(train: Train, learners: list[ConceptNode], robot: RobotDescription) -> dict[str, int]:
    """What all leaves that learn under one Train see.

    Raises:
        InputError: Two of them differ in what they see or do.
    """
    first = learners[0]
    layout = dict(first.model.layout(robot))
    for leaf in learners[1:]:
        if dict(leaf.model.layout(robot)) != layout or leaf.model.actions != first.model.actions:
            raise InputError(
                f"'{first.name}' and '{leaf.name}' below '{train.name}' see or do different things: "
                f"give each its own Train(...)"
            )
    return layout
