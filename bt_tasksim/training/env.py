"""An activation of a subtree under `Train` as an episode of reinforcement learning (`gymnasium.Env`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Any

import gymnasium
import numpy as np
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept import TIMED_OUT, VIOLATED, ConceptModel, Decision
from bt_tasksim.engines.registry import EngineOptions
from bt_tasksim.errors import BtTasksimError, InputError, LeafError
from bt_tasksim.policy import Action, Policy, split_action
from bt_tasksim.poses import Array
from bt_tasksim.runner import LONGEST, Runner, end_all, failed_leaf, raising_leaf
from bt_tasksim.scene import Scene
from bt_tasksim.training.decorator import Train, concepts_in, train_nodes
from bt_tasksim.training.follower import Judgement, Outcome
from bt_tasksim.training.reward import PARTS, Reward

REDRAWS = 50
"""Draws in a row in which the subtree may stay inactive."""
CAMERA = "overview"


class EpisodeEnv(gymnasium.Env[Array, Array]):
    """One activation of what stands under a `Train` node, as an episode.

    ``reset`` draws a world and ticks the tree until a leaf under training is about to act; ``step`` gives it
    an action and goes on to its next decision. Earlier siblings run first; once the subtree says SUCCESS,
    what follows it runs to its end within that same ``step`` and pays the sufficient reward.

    An action holds the concept's motion in [-1, 1] and, last, the completion signal: above
    `bt_tasksim.policy.TERMINATE` the task is done, and the motion counts for nothing.

    ``info`` of a step: ``reward`` (its parts by name, see `Reward`); and of an episode's last one:
    ``is_success``, ``status`` (of the subtree), ``follower`` (status of what follows), ``why``, ``discarded``
    (the judgement was spoiled: ``truncated`` and no sufficient reward) and ``seconds``.

    Args:
        tree: The tree, with one `Train` node at least.
        scene: The scene.
        train: Name of the `Train` node; by default the first one.
        options: Engines; by default SAPIEN with the noise model ``original``.
        reward: What is paid.
        stream: Stream of draws, see `bt_tasksim.scene.STREAMS`.
        lesson: Number of the scene's lesson that worlds are drawn from; None: the scene itself.
        longest: Seconds of an episode, earlier siblings included, after which it is truncated.
        render_mode: ``rgb_array``, or None.
        policies: Policies of other leaves, by the leaf's name: what was trained before.

    Raises:
        InputError: There is no `Train` node, nothing under it can learn, or the leaves that learn differ in
            what they see or do.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}

    def __init__(
        self,
        tree: Behaviour,
        scene: Scene,
        train: str | None = None,
        options: EngineOptions | None = None,
        reward: Reward | None = None,
        stream: str = "training",
        lesson: int | None = None,
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
        self.tree, self.scene = tree, scene
        self.reward = reward or Reward()
        self.stream, self.lesson, self.render_mode = stream, lesson, render_mode
        self.layout = shared_layout(self.train, self.learners, self.runner.robot)
        n, m = sum(self.layout.values()), self.learners[0].actions
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (n,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (m + 1,), np.float32)
        self._action_shape = (m + 1,)
        self.judgement = Judgement(self.train, self.runner.context)
        self.redrawn = 0
        """Draws so far in which the subtree was never active."""
        self.discarded = 0
        """Episodes so far whose judgement an error spoiled."""
        self._ticking: Iterator[Any] | None = None
        self._decision: Decision | None = None
        self._limit = 0

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
                leaf = failed_leaf(self.tree)
                raise InputError(
                    f"'{self.train.name}' was not reached in {redrawn} draws; the last one (seed {draw}) "
                    f"ended with {self.tree.status.name}: {leaf.feedback_message if leaf is not None else ''}"
                )
        self.redrawn += redrawn
        self._cost0 = self._cost(decision)
        self._potential = 0.0
        self._leaf = decision.leaf
        self._before = decision
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
        return self.act(split_action(action))

    def act(self, action: Action) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """`step` with what a policy decides: a programmed one may ask for more than an action's bounds allow.

        Raises:
            RuntimeError: There is no episode.
        """
        decision = self._decision
        if decision is None:
            raise RuntimeError("step() without an episode: call reset() first")
        decision.leaf.decide(action)
        self._decision = None
        parts = dict.fromkeys(PARTS, 0.0)
        found = self._until_decision()
        if found is not None:
            self._decision = found
            parts["shaping"] = self._shape(found)
            return self._features(found), parts["shaping"], False, False, {"reward": parts}
        return self._end(parts)

    def render(self) -> Array | None:
        """The picture ``(height, width, 3)`` of a camera beside the robot, uint8."""
        if self.render_mode is None:
            return None
        assert self.runner.pipeline is not None
        return self.runner.pipeline.render(CAMERA).colour

    def close(self) -> None:
        """Let go of engines; the tree can be run again."""
        self._drop()
        for leaf in self.learners:
            leaf.under_training = False
        assert self.runner.pipeline is not None
        self.runner.pipeline.close()

    # ---- the episode ------------------------------------------------------------------------------------

    def _begin(self, draw: int) -> Decision | None:
        self._drop()
        configuration = self.scene.sample(draw, self.stream, self.lesson)
        self._world = self.runner.reset(configuration)
        self.judgement.tolerance = configuration.tolerance
        self.judgement.reset()
        self._ticks_left = round(self.runner.longest * configuration.control_frequency)
        self._activation: int | None = None
        self._outcome: Outcome | None = None
        self._over = ""
        self._decision = self._until_decision()
        return self._decision

    def _until_decision(self) -> Decision | None:
        """Tick and step until a leaf under training is about to act, or the activation has ended (None)."""
        train = self.train
        while True:
            node = self._next_node()
            if isinstance(node, Decision):
                if self._activation is None:
                    self._activation = train.activations
                    if self.judgement.follower is not None:
                        self.judgement.reset()  # what it did in earlier rounds
                if train.activations == self._activation:
                    return node
                self._over = "interrupted"
                return None
            self.judgement.saw(node)
            if node is train and train.status != Status.RUNNING:
                if self._activation is None:  # nothing was decided
                    self.judgement.reset()
                    continue
                if train.status == Status.SUCCESS:
                    self._outcome = self._follow()
                self._over = "ended"
                return None
            if node is not None:
                continue
            if self._activation is not None and train.status != Status.RUNNING:
                self._over = "interrupted"
                return None
            if self.tree.status != Status.RUNNING:
                self._over = "never began"
                return None
            if not self._control_period():
                self._over = "time over"
                return None

    def _follow(self) -> Outcome:
        """Run what follows to its end."""
        judgement = self.judgement
        try:
            outcome = judgement.ended(self.train)
            while outcome is None:
                node = self._next_node()
                if isinstance(node, Decision):
                    return Outcome(
                        False, "INVALID", f"'{self.train.name}' began anew before what follows ended"
                    )
                judgement.saw(node)
                outcome = judgement.ended(node)
                if outcome is None and node is None:
                    if self.tree.status != Status.RUNNING:
                        return Outcome(False, "INVALID", "the tree ended before what follows did")
                    if not self._control_period():
                        return Outcome(False, "RUNNING", "what follows did not end in time", discarded=True)
            return outcome
        except (InputError, LeafError):
            raise
        except BtTasksimError as error:
            return Outcome(False, "INVALID", str(error), discarded=True)

    def _next_node(self) -> Any:
        """The next node that the present tick visits; None at its end."""
        if self._ticking is None:
            self._ticking = self.tree.tick()
        try:
            return next(self._ticking)
        except StopIteration:
            self._ticking = None
            return None
        except BaseException as error:
            self._ticking = None
            culprit = raising_leaf(error, self.tree)
            end_all(self.tree, culprit)
            if isinstance(error, BtTasksimError) or not isinstance(error, Exception):
                raise
            name = culprit.name if culprit is not None else self.tree.name
            raise LeafError(f"leaf '{name}' raised {type(error).__name__}: {error}") from error

    def _control_period(self) -> bool:
        if self._ticks_left <= 0:
            return False
        self._ticks_left -= 1
        self.runner.step(self.runner.context.command)
        return True

    def _end(self, parts: dict[str, float]) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """The last step of an episode: what is paid, and why."""
        train, outcome = self.train, self._outcome
        leaf = self._before.leaf
        why, truncated = leaf.feedback_message, False
        if self._over in ("interrupted", "time over"):
            why, truncated = self._over, self._over == "time over"
        elif outcome is not None:
            why, truncated = outcome.why, outcome.discarded
            if not outcome.discarded and self.reward.sufficient:
                parts["success" if outcome.success else "failure"] = (
                    self.reward.success if outcome.success else self.reward.failure
                )
        elif why.startswith(VIOLATED):
            parts["violated"] = self.reward.violated
        elif why.startswith(TIMED_OUT):
            parts["timeout"] = self.reward.timeout
        else:
            failed = failed_leaf(train)
            why = failed.feedback_message if failed is not None else why
            parts["failure"] = self.reward.failure
        kept = truncated or (outcome is not None and (outcome.success or not self.reward.sufficient))
        if kept:  # the present observation is charged once: there is no state after it
            parts["shaping"] = self.reward.shape(self._potential, self._potential)
        else:
            parts["shaping"] = self.reward.take_back(self._potential)
        self.discarded += truncated and outcome is not None
        info = {
            "reward": parts,
            "is_success": outcome is not None and outcome.success and not outcome.discarded,
            "status": train.status.name,
            "follower": "" if outcome is None else outcome.status,
            "why": why,
            "discarded": outcome is not None and outcome.discarded,
            "seconds": self.runner.context.now,
        }
        features = self._features(self._before)
        self._drop()
        return features, sum(parts.values()), not truncated, truncated, info

    def _drop(self) -> None:
        """End a tick that is suspended."""
        self._decision = None
        if self._ticking is not None:
            close = getattr(self._ticking, "close", None)
            self._ticking = None
            if close is not None:
                close()

    def _features(self, decision: Decision) -> Array:
        """What the leaf sees; kept for the episode's last step."""
        self._before = decision
        model = decision.leaf.model
        found = np.asarray(model.features(decision.seen, decision.memory), np.float32)
        if found.shape != self.observation_space.shape:
            raise InputError(
                f"'{decision.leaf.name}': features() gives {found.shape}, layout() says "
                f"{self.observation_space.shape}"
            )
        return found

    def _cost(self, decision: Decision) -> float:
        return float(decision.leaf.model.necessary_cost(decision.seen, decision.memory))

    def _shape(self, decision: Decision) -> float:
        """Shaping for the way from the last decision to this one; a new leaf starts from nothing."""
        cost = self._cost(decision)
        if decision.leaf is not self._leaf:
            self._leaf, self._cost0, self._potential = decision.leaf, cost, 0.0
            return 0.0
        before, self._potential = self._potential, self._cost0 - cost
        return self.reward.shape(before, self._potential)


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


def shared_layout(train: Train, learners: list[ConceptModel], robot: Any) -> dict[str, int]:
    """What all leaves that learn under one Train see.

    Raises:
        InputError: Two of them differ in what they see or do.
    """
    first = learners[0]
    layout = dict(first.layout(robot))
    for leaf in learners[1:]:
        if dict(leaf.layout(robot)) != layout or leaf.actions != first.actions:
            raise InputError(
                f"'{first.name}' and '{leaf.name}' below '{train.name}' see or do different things: "
                f"give each its own Train(...)"
            )
    return layout
