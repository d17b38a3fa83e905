"""An activation of a subtree under `Train` as an episode of reinforcement learning (`gymnasium.Env`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import gymnasium
import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.renamed import renamed_arguments
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import LONGEST
from bt_tasksim.policy.policy import Action, Policy, split_action
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.training.decision import Decision
from bt_tasksim.training.drawn_worlds import Draws
from bt_tasksim.training.endings import Ending
from bt_tasksim.training.episode_batch import EpisodeBatch
from bt_tasksim.training.happened import Happened
from bt_tasksim.training.learning_leaves import checked_actions
from bt_tasksim.training.reward import Reward

CAMERA = "overview"
ONE = np.array([0])
"""Rows of its worlds: there is one."""


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
        build: Makes one more tree of the same shape: so that what a behaviour of your own remembers ends with
            its episode. Without it such a behaviour is the tree's own in all episodes.

    Raises:
        InputError: See `bt_tasksim.training.episode_batch.EpisodeBatch`: it is one of one world.
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
        build: Callable[[], Behaviour] | None = None,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise InputError(f"render_mode should be 'rgb_array' or None, found {render_mode!r}")
        options = options or EngineOptions(noise="original", rendering=render_mode is not None)
        about = tree, scene, train, options, reward, longest, policies
        self.batch = EpisodeBatch(*about, worlds=1, build=build)
        self.tree, self.scene = tree, self.batch.scene
        self.train, self.learners = self.batch.train, self.batch.learners
        self.reward, self.layout = self.batch.reward, self.batch.layout
        self.observation_space, self.action_space = self.batch.observation_space, self.batch.action_space
        self.stream, self.stage, self.render_mode = stream, stage, render_mode
        self.redrawn = 0
        """Draws so far that had no world, or in which the subtree was never active."""
        self.discarded = 0
        """Episodes so far whose judgement an error spoiled."""
        self.ending: Ending | None = None
        """How the last episode that was over ended."""

    @property
    def decision(self) -> Decision | None:
        """What the leaf under training sees and remembers while its action is waited for; else None."""
        return self.batch.decision(0)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Draw worlds until the subtree is about to act in one.

        Args:
            seed: Seed of the draws to come.
            options: ``draw``: the seed of this very world, instead of a random one.

        Raises:
            InputError: Many draws in a row had no world, or the tree ended without activating the subtree.
            ClosedEnvironmentError: It is closed.
        """
        super().reset(seed=seed)
        given = None if options is None else options.get("draw")
        draw = None if given is None else int(given)
        self.batch.begin(0, Draws(self.np_random, draw, self.stream, self.stage))
        found = self._happened()
        self.redrawn += found.redrawn
        return found.features, {"draw": found.draw, "redrawn": found.redrawn}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Give the leaf its action ``(actions + 1,)`` and go on to its next decision or the episode's end.

        Raises:
            InputError: The action has the wrong shape or is not finite.
            RuntimeError: There is no episode.
        """
        self._check_waiting()
        self.batch.act(ONE, split_action(checked_actions(action, *self.batch.action_space.shape)[None]))
        return self._stepped()

    def act(self, action: Action) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """`step` with what a policy decides: a programmed one may ask for more than an action's bounds allow.

        Raises:
            RuntimeError: There is no episode.
        """
        self._check_waiting()
        self.batch.act(ONE, action)
        return self._stepped()

    def render(self) -> Array | None:
        """The picture ``(height, width, 3)`` of a camera beside the robot, uint8."""
        return None if self.render_mode is None else self.batch.worlds.picture(CAMERA)

    def close(self) -> None:
        """Let go of engines; the tree can be run again."""
        self.batch.close()

    def _check_waiting(self) -> None:
        self.batch.check_open()
        if not len(self.batch.waiting):
            raise RuntimeError("step() without an episode: call reset() first")

    def _happened(self) -> Happened:
        """What comes next."""
        (found,) = self.batch.go_on()
        if found.error is not None:
            raise found.error
        return found

    def _stepped(self) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        found = self._happened()
        assert found.paid is not None, "a decision came before"
        reward, ending = sum(found.paid.values()), found.ending
        if ending is None:
            return found.features, reward, False, False, {"reward": found.paid}
        self.ending = ending
        self.discarded += ending.discarded
        return found.features, reward, not ending.truncated, ending.truncated, ending.info(found.paid)
