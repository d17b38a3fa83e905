"""Episodes of a training, and what they bring back: those of a rollout, and those of held-apart draws.

An episode does not know whose world it runs in, nor what runs beside it: what it brings back depends on its
task alone.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.training.endings import Ending

NOISE = 64
"""Decisions for which noise is drawn at a time."""


class Begin(NamedTuple):
    """Which episode begins.

    Attributes:
        seed: Of its draws.
        draw: The seed of its world; None: drawn.
        stream: Stream of draws, see `bt_tasksim.scene.configuration.STREAMS`.
        stage: Number of the scene's stage; None: the scene itself.
    """

    seed: int
    draw: int | None
    stream: str
    stage: int | None


class EpisodeEnd(NamedTuple):
    """How an episode of a rollout ended.

    Attributes:
        success: The completion signal was right.
        decisions: How many it had.
        total: What it paid in all.
        reason: See `Ending.counted_as`.
    """

    success: bool
    decisions: int
    total: float
    reason: str


class DrawResult(NamedTuple):
    """What came of a held-apart draw.

    Attributes:
        draw: The seed of its world.
        success: The completion signal was right.
        reason: As of an `EpisodeEnd`, or why the draw has no episode.
    """

    draw: int
    success: bool
    reason: str


@dataclass(frozen=True)
class EpisodeRollout:
    """What an episode of a rollout brought back; ``n`` decisions.

    Attributes:
        features: ``(n, n_features)`` as the concept gave them.
        actions: ``(n, n_actions)`` as drawn, before they were cut off.
        rewards: ``(n,)``.
        cut: Features ``(n_features,)`` after the last decision, where it was truncated; None: it terminated.
        end: How it ended.
        redrawn: Draws before it in which the subtree was never active.
    """

    features: Array
    actions: Array
    rewards: Array
    cut: Array | None
    end: EpisodeEnd
    redrawn: int


class Collecting(abc.ABC):
    """An episode that goes on, in whichever world.

    Attributes:
        result: What came of it, once it is over.
    """

    result: Any = None

    @abc.abstractmethod
    def begin(self) -> Begin:
        """Which episode it is."""

    @abc.abstractmethod
    def began(self, redrawn: int) -> None:
        """It has begun, after so many draws without one."""

    @abc.abstractmethod
    def action(self, features: Array, output: Array) -> Array:
        """What stands in for the network's outputs ``(m,)`` where features ``(n,)`` are seen."""

    @abc.abstractmethod
    def paid(self, features: Array, reward: float, ending: Ending | None) -> None:
        """What the decision paid, and the features ``(n,)`` after it.

        Args:
            features: What is seen next; at an end what was seen last.
            reward: What was paid.
            ending: How the episode ended, where it is over.
        """

    @abc.abstractmethod
    def failed(self, error: Exception) -> None:
        """There is no such episode.

        Raises:
            Exception: The error, unless it is known what to make of it.
        """


class EpisodeTask(abc.ABC):
    """An episode, for whoever keeps a batch of worlds.

    Attributes:
        network: Arrays of the policy's network.
    """

    network: dict[str, Array]

    @abc.abstractmethod
    def episode(self) -> Collecting:
        """The episode, before its first decision."""


@dataclass(frozen=True)
class RolloutTask(EpisodeTask):
    """An episode of a rollout, with noise on what is decided.

    Attributes:
        network: Arrays of the policy's network.
        std: Standard deviations ``(n_actions,)`` of the noise on its outputs.
        seed: Of draws and noise.
        stage: Number of the scene's stage that the world is drawn from; None: the scene itself.
    """

    network: dict[str, Array]
    std: Array
    seed: tuple[int, ...]
    stage: int | None = None

    def episode(self) -> Collecting:
        """See `EpisodeTask.episode`."""
        return _RolloutEpisode(self)


@dataclass(frozen=True)
class DrawTask(EpisodeTask):
    """The evaluation of one held-apart draw, without noise.

    Attributes:
        network: Arrays of the policy's network.
        draw: The seed of its world.
    """

    network: dict[str, Array]
    draw: int

    def episode(self) -> Collecting:
        """See `EpisodeTask.episode`."""
        return _DrawEpisode(self.draw)


class _RolloutEpisode(Collecting):
    """An episode of a rollout; its result is an `EpisodeRollout`."""

    def __init__(self, task: RolloutTask) -> None:
        self._task = task
        self._rng = np.random.default_rng(task.seed)
        self._seed = int(self._rng.integers(2**31))
        self._noise: Array = np.zeros((0, len(task.std)), np.float32)
        self._features: list[Array] = []
        self._actions: list[Array] = []
        self._rewards: list[float] = []
        self._redrawn = 0

    def begin(self) -> Begin:
        """See `Collecting.begin`."""
        return Begin(self._seed, None, "training", self._task.stage)

    def began(self, redrawn: int) -> None:
        """See `Collecting.began`."""
        self._redrawn = redrawn

    def action(self, features: Array, output: Array) -> Array:
        """See `Collecting.action`."""
        at = len(self._rewards) % NOISE
        if at == 0:
            noise = self._rng.standard_normal((NOISE, len(self._task.std))).astype(np.float32)
            self._noise = noise * self._task.std
        action = output + self._noise[at]
        self._features.append(features)
        self._actions.append(action)
        bounded: Array = np.minimum(np.maximum(action, -1.0), 1.0)
        return bounded

    def paid(self, features: Array, reward: float, ending: Ending | None) -> None:
        """See `Collecting.paid`."""
        self._rewards.append(reward)
        if ending is None:
            return
        n, total = len(self._rewards), sum(self._rewards)
        self.result = EpisodeRollout(
            features=np.array(self._features, np.float32),
            actions=np.array(self._actions, np.float32),
            rewards=np.array(self._rewards, np.float32),
            cut=features if ending.truncated else None,
            end=EpisodeEnd(ending.is_success, n, total, ending.counted_as),
            redrawn=self._redrawn,
        )

    def failed(self, error: Exception) -> None:
        """See `Collecting.failed`."""
        raise error


class _DrawEpisode(Collecting):
    """An episode of a held-apart draw; its result is a `DrawResult`."""

    def __init__(self, draw: int) -> None:
        self._draw = draw

    def begin(self) -> Begin:
        """See `Collecting.begin`."""
        return Begin(self._draw, self._draw, "validation", None)

    def began(self, redrawn: int) -> None:
        """See `Collecting.began`."""

    def action(self, features: Array, output: Array) -> Array:
        """See `Collecting.action`."""
        return output

    def paid(self, features: Array, reward: float, ending: Ending | None) -> None:
        """See `Collecting.paid`."""
        if ending is not None:
            self.result = DrawResult(self._draw, ending.is_success, ending.counted_as)

    def failed(self, error: Exception) -> None:
        """See `Collecting.failed`: a draw may have no episode."""
        if not isinstance(error, InputError):
            raise error
        self.result = DrawResult(self._draw, False, str(error))
