"""What environments bring back: the tasks, and what asks for their episodes and takes note of them.

A collector does not know whose worlds its episodes run in, nor how many at a time: what it brings back
depends on its task alone.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.policy.network import Network
from bt_tasksim.training.endings import Ending

ResultT = TypeVar("ResultT")

LENGTH = 64.0
"""Decisions that an episode is thought to have before any has ended."""
LACK = 0.25
"""Share of an episode that may be thought to lack before one more begins: else much would go to waste."""
GOES_ON = 0.8
"""Share of the usual length that an episode is thought to go on for at least, however long it is: lengths
scatter by some 0.8 of their mean."""
NOISE = 64
"""Decisions for which noise is drawn at a time."""


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
        redrawn: Draws that had no world, or in which the subtree was never active.
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
        length: Decisions that an episode is thought to have: as many are begun side by side as will do, and
            what comes of it does not depend on that.
    """

    network: dict[str, Array]
    std: Array
    seed: tuple[int, ...]
    decisions: int
    stage: int | None = None
    length: float = LENGTH

    def collector(self, network: Network) -> RolloutCollector:
        """What is to be done, episode by episode, with the task's network."""
        return RolloutCollector(self, network)


@dataclass(frozen=True)
class DrawTask:
    """The evaluation of one held-apart draw, for whoever keeps an environment or a batch of worlds.

    Attributes:
        network: Arrays of the policy's network.
        draw: The seed of its world.
    """

    network: dict[str, Array]
    draw: int

    def collector(self, network: Network) -> DrawCollector:
        """What is to be done, episode by episode, with the task's network."""
        return DrawCollector(self, network)


class Collecting(abc.ABC):
    """An episode that is collected, in whichever world."""

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


class Collector(abc.ABC, Generic[ResultT]):
    """Collects what a task asks for, from one episode or several, of which some may go on side by side.

    Args:
        network: The policy's network.

    Attributes:
        network: See there.
    """

    def __init__(self, network: Network) -> None:
        self.network = network

    @abc.abstractmethod
    def next(self) -> Collecting | None:
        """An episode that should begin by now; None: those that go on should do."""

    @abc.abstractmethod
    def counts(self, episode: Collecting) -> bool:
        """Whether an episode that goes on may still have something to do with the result."""

    @property
    @abc.abstractmethod
    def done(self) -> bool:
        """There is a result, though episodes may go on."""

    @abc.abstractmethod
    def result(self) -> ResultT:
        """What came of it, once it is done."""


class RolloutCollector(Collector[EnvironmentRollout]):
    """An environment of a rollout: its first episodes in a row, as many decisions of them as it has.

    Each episode has draws and noise of its own, so that several may go on side by side.

    Args:
        task: Which.
        network: The policy's network.
    """

    def __init__(self, task: RolloutTask, network: Network) -> None:
        super().__init__(network)
        self._task = task
        self._episodes: list[RolloutEpisode] = []
        self._front, self._before = 0, 0  # of the episodes that are over, and so are all before them

    def next(self) -> Collecting | None:
        """See `Collector.next`."""
        length, others = self._task.length, self._episodes[self._front :]
        expected = self._before + sum(
            len(episode.rewards) + (0.0 if episode.over else _to_come(len(episode.rewards), length))
            for episode in others
        )
        going = any(not episode.over for episode in others)
        if going and expected >= self._task.decisions - LACK * length:
            return None
        self._episodes.append(RolloutEpisode(self._task, len(self._episodes), self.network.outputs))
        return self._episodes[-1]

    def counts(self, episode: Collecting) -> bool:
        """See `Collector.counts`."""
        assert isinstance(episode, RolloutEpisode)
        others = self._episodes[self._front : episode.number]
        before = self._before + sum(len(other.rewards) for other in others)
        return not episode.over and before < self._task.decisions

    @property
    def done(self) -> bool:
        """See `Collector.done`; an error that an episode began with comes out when its turn has come."""
        while self._front < len(self._episodes) and self._before < self._task.decisions:
            episode = self._episodes[self._front]
            if episode.error is not None:
                raise episode.error
            if not episode.over:
                return self._before + len(episode.rewards) >= self._task.decisions
            self._before += len(episode.rewards)
            self._front += 1
        return self._before >= self._task.decisions

    def result(self) -> EnvironmentRollout:
        """See `Collector.result`."""
        left, parts = self._task.decisions, []
        cut: list[Array] = []
        cut_at: list[int] = []
        for episode in self._episodes:
            n = min(len(episode.rewards), left)
            if n == 0:
                break
            parts.append((episode, n))
            left -= n
            whole = episode.over and n == len(episode.rewards)
            if not whole or episode.truncated:
                cut.append(episode.features[n] if n < len(episode.features) else episode.after)
                cut_at.append(self._task.decisions - left - 1)
        return EnvironmentRollout(
            features=np.array([row for e, n in parts for row in e.features[:n]], np.float32),
            actions=np.array([row for e, n in parts for row in e.actions[:n]], np.float32),
            rewards=np.array([paid for e, n in parts for paid in e.rewards[:n]], np.float32),
            starts=np.array([k == 0 for _, n in parts for k in range(n)]),
            cut=np.array(cut, np.float32).reshape(len(cut), self.network.inputs),
            cut_at=np.array(cut_at, np.int64),
            ends=[e.end for e, n in parts if e.end is not None and n == len(e.rewards)],
            redrawn=sum(e.redrawn for e, _ in parts),
        )


def _to_come(decisions: int, length: float) -> float:
    """How many more decisions an episode is thought to have after so many."""
    return max(length - decisions, GOES_ON * length)


class RolloutEpisode(Collecting):
    """An episode of an environment, with noise on what is decided.

    Args:
        task: The environment.
        number: Which one of its episodes.
        outputs: Size of what is decided, m.

    Attributes:
        number: Which one.
        features: Of each decision ``(n,)``.
        actions: As drawn ``(m,)``, before they were cut off.
        rewards: What each has paid.
        after: Features after the last decision.
        end: How it ended; None: it goes on.
        truncated: It was cut off.
        redrawn: How many draws had no episode.
        error: Why there is none.
    """

    def __init__(self, task: RolloutTask, number: int, outputs: int) -> None:
        self.number = number
        self._task, self._outputs = task, outputs
        self._rng = np.random.default_rng((*task.seed, number))
        self._seed = int(self._rng.integers(2**31))
        self._noise: Array = np.zeros((0, outputs), np.float32)
        self.features: list[Array] = []
        self.actions: list[Array] = []
        self.rewards: list[float] = []
        self.after: Array = np.zeros(0, np.float32)
        self.end: EpisodeEnd | None = None
        self.truncated = False
        self.redrawn = 0
        self.error: Exception | None = None

    @property
    def over(self) -> bool:
        """It has ended, or there is none."""
        return self.end is not None or self.error is not None

    def begin(self) -> Begin:
        """See `Collecting.begin`."""
        return Begin(self._seed, None, "training", self._task.stage)

    def began(self, redrawn: int) -> None:
        """See `Collecting.began`."""
        self.redrawn = redrawn

    def action(self, features: Array, output: Array) -> Array:
        """See `Collecting.action`."""
        at = len(self.rewards) % NOISE
        if at == 0:
            noise = self._rng.standard_normal((NOISE, self._outputs)).astype(np.float32)
            self._noise = noise * self._task.std
        action = output + self._noise[at]
        self.features.append(features)
        self.actions.append(action)
        bounded: Array = np.minimum(np.maximum(action, -1.0), 1.0)
        return bounded

    def paid(self, features: Array, reward: float, ending: Ending | None) -> None:
        """See `Collecting.paid`."""
        self.rewards.append(reward)
        self.after = features
        if ending is not None:
            total, self.truncated = sum(self.rewards), ending.truncated
            self.end = EpisodeEnd(ending.is_success, len(self.rewards), total, ending.counted_as)

    def failed(self, error: Exception) -> None:
        """See `Collecting.failed`: it is raised when the episodes before are over, if it counts at all."""
        self.error = error


class DrawCollector(Collector[DrawResult]):
    """The evaluation of one held-apart draw.

    Args:
        task: Which.
        network: The policy's network.
    """

    def __init__(self, task: DrawTask, network: Network) -> None:
        super().__init__(network)
        self._task = task
        self._episode: DrawEpisode | None = None

    def next(self) -> Collecting | None:
        """See `Collector.next`."""
        if self._episode is not None:
            return None
        self._episode = DrawEpisode(self._task.draw)
        return self._episode

    def counts(self, episode: Collecting) -> bool:
        """See `Collector.counts`."""
        return not self.done

    @property
    def done(self) -> bool:
        """See `Collector.done`."""
        return self._episode is not None and self._episode.result is not None

    def result(self) -> DrawResult:
        """See `Collector.result`."""
        assert self._episode is not None and self._episode.result is not None, "it is not done"
        return self._episode.result


class DrawEpisode(Collecting):
    """The episode of a held-apart draw, without noise.

    Args:
        draw: The seed of its world.

    Attributes:
        result: What came of it; None: it goes on.
    """

    def __init__(self, draw: int) -> None:
        self._draw = draw
        self.result: DrawResult | None = None

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
