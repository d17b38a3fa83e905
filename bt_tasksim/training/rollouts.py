"""Episodes collected over worker processes, the same whatever their number.

A rollout is a fixed number of environments. Each runs its own episodes for a fixed number of decisions, with
its own seeds, in whichever worker is free: so the number of workers changes the time and nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import split_action
from bt_tasksim.training.env import EpisodeEnv


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


def collect(env: EpisodeEnv, task: RolloutTask) -> EnvironmentRollout:
    """One environment: episodes until there are enough decisions."""
    network = Network.from_arrays(task.network)
    env.stage = task.stage
    rng = np.random.default_rng(task.seed)
    noise = rng.standard_normal((task.decisions, network.outputs)).astype(np.float32) * task.std
    draws = rng.integers(2**31, size=task.decisions + 1).tolist()
    before = env.redrawn
    features, info = env.reset(seed=draws[0])
    rows, actions, rewards, starts, ends = [], [], [], [True], []
    cut, cut_at = [], []
    total, length, episode = 0.0, 0, 0
    for k in range(task.decisions):
        action = network(features) + noise[k]
        rows.append(features)
        actions.append(action)
        features, reward, terminated, truncated, info = env.step(np.minimum(np.maximum(action, -1.0), 1.0))
        rewards.append(reward)
        total, length = total + reward, length + 1
        over = terminated or truncated
        if truncated or (k == task.decisions - 1 and not over):
            cut.append(features)
            cut_at.append(k)
        if over:
            ends.append(EpisodeEnd(bool(info["is_success"]), length, total, _kind(info)))
            total, length, episode = 0.0, 0, episode + 1
            if k < task.decisions - 1:
                features, info = env.reset(seed=draws[episode])
        starts.append(over)
    return EnvironmentRollout(
        features=np.array(rows, np.float32),
        actions=np.array(actions, np.float32),
        rewards=np.array(rewards, np.float32),
        starts=np.array(starts[:-1]),
        cut=np.array(cut, np.float32).reshape(len(cut), network.inputs),
        cut_at=np.array(cut_at, np.int64),
        ends=ends,
        redrawn=env.redrawn - before,
    )


def judge_draw(env: EpisodeEnv, task: DrawTask) -> DrawResult:
    """One held-apart draw with the policy's own decisions."""
    network = Network.from_arrays(task.network)
    env.stage = None
    stream, env.stream = env.stream, "validation"
    try:
        features, info = env.reset(seed=task.draw, options={"draw": task.draw})
        nearer = 0.0
        while True:
            motion, done = split_action(network(features), network.signal_std)
            nearer += float(done)
            action = np.append(motion, 1.0 if nearer >= 1.0 else -1.0)
            features, _, terminated, truncated, info = env.step(action)
            if terminated or truncated:
                return DrawResult(task.draw, bool(info["is_success"]), _kind(info))
    except InputError as error:
        return DrawResult(task.draw, False, str(error))
    finally:
        env.stream = stream


def _kind(info: dict[str, Any]) -> str:
    """A countable reason for the end of an episode."""
    if info["is_success"]:
        return "success"
    if info["discarded"]:
        return "discarded"
    part = next((p for p in ("violated", "timeout") if info["reward"][p] != 0.0), "")
    return part or ("follower failed" if info["status"] == "SUCCESS" else "failed")
