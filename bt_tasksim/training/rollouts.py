"""Episodes collected in batches of worlds, the same whatever their size and the number of processes.

A rollout is a fixed number of environments. Each runs its own episodes for a fixed number of decisions, with
its own seeds, in a world of its own beside others: so what it comes to does not depend on these.
"""

from __future__ import annotations

import abc
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.fleet import Fleet
from bt_tasksim.core.poses import Array
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import split_action
from bt_tasksim.training.env import EpisodeEnv
from bt_tasksim.training.episode_batch import Draws, EpisodeBatch

ResultT = TypeVar("ResultT")


class Begin(NamedTuple):
    """An episode that a lane wants next.

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
    """An environment of a rollout, for a worker that keeps an environment.

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

    def run(self, env: EpisodeEnv, /) -> EnvironmentRollout:
        """See `collect`."""
        return collect(env, self)

    def lane(self) -> RolloutLane:
        """What is to be done, step by step."""
        return RolloutLane(self)


@dataclass(frozen=True)
class DrawTask:
    """The evaluation of one held-apart draw, for a worker that keeps an environment.

    Attributes:
        network: Arrays of the policy's network.
        draw: The seed of its world.
    """

    network: dict[str, Array]
    draw: int

    def run(self, env: EpisodeEnv, /) -> DrawResult:
        """See `judge_draw`."""
        return judge_draw(env, self)

    def lane(self) -> DrawLane:
        """What is to be done, step by step."""
        return DrawLane(self)


def collect(env: EpisodeEnv, task: RolloutTask) -> EnvironmentRollout:
    """One environment: episodes until there are enough decisions."""
    lane = task.lane()
    alone(env, lane)
    return lane.result()


def judge_draw(env: EpisodeEnv, task: DrawTask) -> DrawResult:
    """One held-apart draw with the policy's own decisions."""
    lane = task.lane()
    alone(env, lane)
    return lane.result()


class Lane(abc.ABC, Generic[ResultT]):
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
            The lane is done, though the episode may go on.
        """

    def failed(self, error: Exception) -> None:
        """There is no episode.

        Raises:
            Exception: The error, unless the lane knows what to make of it.
        """
        raise error

    @abc.abstractmethod
    def result(self) -> ResultT:
        """What came of it, once it is done."""


class RolloutLane(Lane[EnvironmentRollout]):
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
        """See `Lane.begin`."""
        if len(self._rewards) == self._task.decisions:
            return None
        return Begin(self._draws[len(self._ends)], None, "training", self._task.stage)

    def began(self, redrawn: int) -> None:
        """See `Lane.began`."""
        self._redrawn += redrawn

    def action(self, features: Array, output: Array) -> Array:
        """See `Lane.action`."""
        action = output + self._noise[len(self._rewards)]
        self._features.append(features)
        self._actions.append(action)
        bounded: Array = np.minimum(np.maximum(action, -1.0), 1.0)
        return bounded

    def paid(self, features: Array, reward: float, ending: Mapping[str, Any] | None, truncated: bool) -> bool:
        """See `Lane.paid`."""
        k = len(self._rewards)
        last, over = k == self._task.decisions - 1, ending is not None
        self._rewards.append(reward)
        self._total, self._length = self._total + reward, self._length + 1
        if truncated or (last and not over):
            self._cut.append(features)
            self._cut_at.append(k)
        if ending is not None:
            end = EpisodeEnd(bool(ending["is_success"]), self._length, self._total, _kind(ending))
            self._ends.append(end)
            self._total, self._length = 0.0, 0
        self._starts.append(over)
        return last

    def result(self) -> EnvironmentRollout:
        """See `Lane.result`."""
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


class DrawLane(Lane[DrawResult]):
    """The evaluation of one held-apart draw.

    Args:
        task: Which.
    """

    def __init__(self, task: DrawTask) -> None:
        super().__init__(task.network)
        self._draw, self._nearer = task.draw, 0.0
        self._result: DrawResult | None = None

    def begin(self) -> Begin | None:
        """See `Lane.begin`."""
        return None if self._result is not None else Begin(self._draw, self._draw, "validation", None)

    def began(self, redrawn: int) -> None:
        """See `Lane.began`."""

    def action(self, features: Array, output: Array) -> Array:
        """See `Lane.action`."""
        motion, done = split_action(output, self.network.signal_std)
        self._nearer += float(done)
        return np.append(motion, 1.0 if self._nearer >= 1.0 else -1.0)

    def paid(self, features: Array, reward: float, ending: Mapping[str, Any] | None, truncated: bool) -> bool:
        """See `Lane.paid`."""
        if ending is not None:
            self._result = DrawResult(self._draw, bool(ending["is_success"]), _kind(ending))
        return ending is not None

    def failed(self, error: Exception) -> None:
        """See `Lane.failed`: a draw may have no episode."""
        if not isinstance(error, InputError):
            raise error
        self._result = DrawResult(self._draw, False, str(error))

    def result(self) -> DrawResult:
        """See `Lane.result`."""
        assert self._result is not None, "it is not done"
        return self._result


def alone(env: EpisodeEnv, lane: Lane[Any]) -> None:
    """Run a lane in an environment."""
    stream, stage = env.stream, env.stage
    try:
        while (wanted := lane.begin()) is not None:
            env.stream, env.stage = wanted.stream, wanted.stage
            options = None if wanted.draw is None else {"draw": wanted.draw}
            features, info = env.reset(seed=wanted.seed, options=options)
            lane.began(int(info["redrawn"]))
            over = False
            while not over:
                action = lane.action(features, lane.network(features))
                features, reward, terminated, truncated, info = env.step(action)
                ended = terminated or truncated
                over = lane.paid(features, reward, info if ended else None, truncated) or ended
    except InputError as error:
        lane.failed(error)
    finally:
        env.stream, env.stage = stream, stage


def in_batch(batch: EpisodeBatch, tasks: Sequence[Any], /) -> Iterator[tuple[int, Any]]:
    """Do tasks in the worlds of a batch: each world takes the next one when it has done one.

    Yields:
        The index of a task and its result, as they are done; these depend on nothing but the task.
    """
    waiting = iter(enumerate(tasks))
    lanes: dict[int, tuple[int, Lane[Any]]] = {}
    networks: dict[int, Network] = {}  # by the identity of their arrays, of which tasks share one
    done: list[tuple[int, Any]] = []

    def next_task(row: int) -> None:
        """A world takes the next task, if there is one."""
        lanes.pop(row, None)
        for index, task in waiting:
            lane = task.lane()
            lane.network = networks.setdefault(id(task.network), lane.network)
            lanes[row] = index, lane
            if next_episode(row):
                return

    def next_episode(row: int) -> bool:
        """The lane of a world goes on, or is done."""
        index, lane = lanes[row]
        wanted = lane.begin()
        if wanted is None:
            done.append((index, lane.result()))
            return False
        rng = np.random.default_rng(wanted.seed)
        batch.begin(row, Draws(rng, wanted.draw, wanted.stream, wanted.stage))
        return True

    for row in range(batch.count):
        next_task(row)
    try:
        while lanes:
            asked: list[tuple[int, Array]] = []
            for event in batch.go_on():
                row, (_, lane) = event.row, lanes[event.row]
                over = event.ending is not None or event.error is not None
                if event.error is not None:
                    lane.failed(event.error)
                elif event.paid is None:
                    lane.began(event.redrawn)
                else:
                    reward = sum(event.paid.values())
                    said = None if event.ending is None else event.ending.info(event.paid)
                    truncated = event.ending is not None and event.ending.truncated
                    over = lane.paid(event.features, reward, said, truncated) or over
                if not over:
                    asked.append((row, event.features))
                elif not next_episode(row):
                    batch.leave(row)
                    next_task(row)
            yield from done
            done.clear()
            _decide(batch, lanes, asked)
    finally:
        for row in lanes:
            batch.leave(row)


def side_by_side(
    keeper: EpisodeBatch | EpisodeEnv, shares: Sequence[Sequence[Any]], /
) -> Iterator[tuple[int, list[Any]]]:
    """Work for a fleet whose members keep a batch of worlds, or an environment: do shares of tasks."""
    for index, tasks in enumerate(shares):
        if isinstance(keeper, EpisodeBatch):
            done = dict(in_batch(keeper, tasks))
        else:
            done = {k: task.run(keeper) for k, task in enumerate(tasks)}
        yield index, [done[k] for k in range(len(tasks))]


def results(fleet: Fleet[EpisodeBatch | EpisodeEnv], tasks: Sequence[Any], members: int) -> list[Any]:
    """The results of tasks, in their order.

    Args:
        fleet: Does them.
        tasks: The tasks.
        members: How many it has; each gets an equal share, so that its worlds have something to do.
    """
    shares = [tasks[k::members] for k in range(min(members, len(tasks)))]
    out: list[Any] = [None] * len(tasks)
    for k, found in fleet.spread(side_by_side, shares):
        out[k::members] = found
    return out


def _decide(
    batch: EpisodeBatch, lanes: Mapping[int, tuple[int, Lane[Any]]], asked: Sequence[tuple[int, Array]]
) -> None:
    """Decide in all worlds ``asked``, each with what it sees: one call for each network."""
    groups: dict[int, list[tuple[int, Array]]] = {}
    for row, features in asked:
        groups.setdefault(id(lanes[row][1].network), []).append((row, features))
    for group in groups.values():
        rows = np.array([row for row, _ in group])
        outputs = lanes[group[0][0]][1].network(np.stack([features for _, features in group]))
        actions = [
            lanes[row][1].action(features, output)
            for (row, features), output in zip(group, outputs, strict=True)
        ]
        batch.decide(rows, np.stack(actions))


def _kind(info: Mapping[str, Any]) -> str:
    """A countable reason for the end of an episode."""
    if info["is_success"]:
        return "success"
    if info["discarded"]:
        return "discarded"
    part = next((p for p in ("violated", "timeout") if info["reward"][p] != 0.0), "")
    return part or ("follower failed" if info["status"] == "SUCCESS" else "failed")
