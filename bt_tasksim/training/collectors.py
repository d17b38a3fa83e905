"""What environments bring back: the tasks, and what asks for their episodes and takes note of them.

A collector runs whole episodes in one world and does not know whose it is: so what it brings back depends on
its task alone.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import split_action

ResultT = TypeVar("ResultT")


class Begin(NamedTuple):
    """An episode that a collector wants next.

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
        reason: A countable one: ``success``, ``discarded``, ``violated``, ``timeout``, ``follower failed``
            or ``failed``.
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
class EnvironmentRollout:
    """What one environment brought back; ``n`` decisions.

    Attributes:
        features: ``(n, n_features)`` as the concept gave them.
        actions: ``(n, n_actions)`` as drawn, before they were cut off.
        rewards: ``(n,)``.
        starts: ``(n,)`` boolean, the decision is the first one of its episode.
        cut: Features ``(k, n_features)`` after decisions ``cut_at (k,)`` at which an episode was truncated.
        cut_at: See ``cut``; the environment's last decision is among them unless its episode ended there.
        ends: One for each episode that ended.
        redrawn: Draws in which the subtree was never active.
    """

    features: Array
    actions: Array
    rewards: Array
    starts: Array
    cut: Array
    cut_at: Array
    ends: list[EpisodeEnd]
    redrawn: int


@dataclass(frozen=True)
class RolloutTask:
    """An environment of a rollout, for whoever keeps an environment or a batch of worlds.

    Attributes:
        network: Arrays of the policy's network.
        std: Standard deviations ``(n_actions,)`` of the noise on its outputs.
        seed: Of draws and noise.
        decisions: How many.
        stage: Number of the scene's stage that worlds are drawn from; None: the scene itself.
    """

    network: dict[str, Array]
    std: Array
    seed: tuple[int, ...]
    decisions: int
    stage: int | None = None

    def collector(self) -> RolloutCollector:
        """What is to be done, step by step."""
        return RolloutCollector(self)


@dataclass(frozen=True)
class DrawTask:
    """The evaluation of one held-apart draw, for whoever keeps an environment or a batch of worlds.

    Attributes:
        network: Arrays of the policy's network.
        draw: The seed of its world.
    """

    network: dict[str, Array]
    draw: int

    def collector(self) -> DrawCollector:
        """What is to be done, step by step."""
        return DrawCollector(self)


class Collector(abc.ABC, Generic[ResultT]):
    """A row of episodes in a world, which asks for each next step; whose world it is does not matter.

    Args:
        network: Arrays of the policy's network.

    Attributes:
        network: It.
    """

    def __init__(self, network: dict[str, Array]) -> None:
        self.network = Network.from_arrays(network)

    @abc.abstractmethod
    def begin(self) -> Begin | None:
        """The next episode; None: it is done."""

    @abc.abstractmethod
    def began(self, redrawn: int) -> None:
        """An episode has begun, after so many draws without one."""

    @abc.abstractmethod
    def action(self, features: Array, output: Array) -> Array:
        """What is decided ``(m,)`` where features ``(n,)`` are seen, and the network says ``(m,)``."""

    @abc.abstractmethod
    def paid(self, features: Array, reward: float, ending: Mapping[str, Any] | None, truncated: bool) -> bool:
        """What the decision paid, and the features ``(n,)`` after it.

        Args:
            features: What is seen next; at an end what was seen last.
            reward: What was paid.
            ending: What is said of the episode, where it is over.
            truncated: It was cut off.

        Returns:
            The collector is done, though the episode may go on.
        """

    def failed(self, error: Exception) -> None:
        """There is no episode.

        Raises:
            Exception: The error, unless the collector knows what to make of it.
        """
        raise error

    @abc.abstractmethod
    def result(self) -> ResultT:
        """What came of it, once it is done."""


class RolloutCollector(Collector[EnvironmentRollout]):
    """An environment of a rollout.

    Args:
        task: Which.
    """

    def __init__(self, task: RolloutTask) -> None:
        super().__init__(task.network)
        self._task = task
        rng, n = np.random.default_rng(task.seed), self.network.outputs
        self._noise = rng.standard_normal((task.decisions, n)).astype(np.float32) * task.std
        self._draws: list[int] = rng.integers(2**31, size=task.decisions + 1).tolist()
        self._features: list[Array] = []
        self._actions: list[Array] = []
        self._rewards: list[float] = []
        self._starts, self._over = [True], True
        self._cut: list[Array] = []
        self._cut_at: list[int] = []
        self._ends: list[EpisodeEnd] = []
        self._total, self._length, self._redrawn = 0.0, 0, 0

    def begin(self) -> Begin | None:
        """See `Collector.begin`."""
        if len(self._rewards) == self._task.decisions:
            return None
        return Begin(self._draws[len(self._ends)], None, "training", self._task.stage)

    def began(self, redrawn: int) -> None:
        """See `Collector.began`."""
        self._redrawn += redrawn

    def action(self, features: Array, output: Array) -> Array:
        """See `Collector.action`."""
        action = output + self._noise[len(self._rewards)]
        self._features.append(features)
        self._actions.append(action)
        bounded: Array = np.minimum(np.maximum(action, -1.0), 1.0)
        return bounded

    def paid(self, features: Array, reward: float, ending: Mapping[str, Any] | None, truncated: bool) -> bool:
        """See `Collector.paid`."""
        k = len(self._rewards)
        last, over = k == self._task.decisions - 1, ending is not None
        self._rewards.append(reward)
        self._total, self._length = self._total + reward, self._length + 1
        if truncated or (last and not over):
            self._cut.append(features)
            self._cut_at.append(k)
        if ending is not None:
            end = EpisodeEnd(bool(ending["is_success"]), self._length, self._total, countable(ending))
            self._ends.append(end)
            self._total, self._length = 0.0, 0
        self._starts.append(over)
        return last

    def result(self) -> EnvironmentRollout:
        """See `Collector.result`."""
        return EnvironmentRollout(
            features=np.array(self._features, np.float32),
            actions=np.array(self._actions, np.float32),
            rewards=np.array(self._rewards, np.float32),
            starts=np.array(self._starts[:-1]),
            cut=np.array(self._cut, np.float32).reshape(len(self._cut), self.network.inputs),
            cut_at=np.array(self._cut_at, np.int64),
            ends=self._ends,
            redrawn=self._redrawn,
        )


class DrawCollector(Collector[DrawResult]):
    """The evaluation of one held-apart draw.

    Args:
        task: Which.
    """

    def __init__(self, task: DrawTask) -> None:
        super().__init__(task.network)
        self._draw, self._nearer = task.draw, 0.0
        self._result: DrawResult | None = None

    def begin(self) -> Begin | None:
        """See `Collector.begin`."""
        return None if self._result is not None else Begin(self._draw, self._draw, "validation", None)

    def began(self, redrawn: int) -> None:
        """See `Collector.began`."""

    def action(self, features: Array, output: Array) -> Array:
        """See `Collector.action`."""
        motion, done = split_action(output, self.network.signal_std)
        self._nearer += float(done)
        return np.append(motion, 1.0 if self._nearer >= 1.0 else -1.0)

    def paid(self, features: Array, reward: float, ending: Mapping[str, Any] | None, truncated: bool) -> bool:
        """See `Collector.paid`."""
        if ending is not None:
            self._result = DrawResult(self._draw, bool(ending["is_success"]), countable(ending))
        return ending is not None

    def failed(self, error: Exception) -> None:
        """See `Collector.failed`: a draw may have no episode."""
        if not isinstance(error, InputError):
            raise error
        self._result = DrawResult(self._draw, False, str(error))

    def result(self) -> DrawResult:
        """See `Collector.result`."""
        assert self._result is not None, "it is not done"
        return self._result


def countable(info: Mapping[str, Any]) -> str:
    """A countable reason for the end of an episode."""
    if info["is_success"]:
        return "success"
    if info["discarded"]:
        return "discarded"
    part = next((p for p in ("violated", "timeout") if info["reward"][p] != 0.0), "")
    return part or ("follower failed" if info["status"] == "SUCCESS" else "failed")
