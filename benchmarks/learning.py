"""How fast one learns: ratios within one run, in turns, medians over rounds.

    python -m benchmarks.learning            # some minutes, on an idle machine
    python -m benchmarks.learning --quick

1. Environment steps per second without a learner: ``grasp_then_pick``, whole episodes with resets and what
   follows, against ManiSkill's ``PickCube-v1``; both with actions that were decided beforehand, 100 Hz
   physics and 20 Hz control, one step being one control period; in one process and in two.
2. Transitions per second that a learner gets: our `train` with two workers against stable-baselines3 PPO on
   ``PickCube-v1`` with the same network, rollout, minibatch and epochs, the better of one process and two. A
   transition of ours is a decision: control periods before the approach and during the pick come on top.
3. What a decision costs on the robot: the network, and with its features; and how far it is from torch.

Writes ``benchmarks/results/learning.json``.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasp import untrained
from benchmarks.peer_maniskill import Peer
from benchmarks.success import RESULTS
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.core.files import write_text
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import LearnedPolicy, load_policy
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.env import EpisodeEnv
from bt_tasksim.trees.scenarios import grasp_then_pick

ROLLOUT_STEPS = 256
"""Decisions of an environment."""
DEVIATION = 0.165
"""Standard deviation of the noise on the actions, as in the middle of a training."""


@dataclass(frozen=True)
class Row:
    """One row of the table; digits below zero: in powers of ten."""

    key: str
    label: str
    unit: str = ""
    digits: int = 0
    bar: str = ""

    def text(self, value: float) -> str:
        """A value with its unit."""
        return f"{value:.1e}" if self.digits < 0 else f"{value:.{self.digits}f} {self.unit}".strip()


ROWS = (
    Row("steps_1", "`grasp_then_pick`, control periods, 1 process", "1/s"),
    Row("peer_steps_1", "ManiSkill `PickCube-v1`, the same", "1/s"),
    Row("steps_ratio_1", "ratio", digits=2, bar="at least 3"),
    Row("steps_2", "`grasp_then_pick`, control periods, 2 processes", "1/s"),
    Row("peer_steps_2", "ManiSkill `PickCube-v1`, the same (SubprocVecEnv)", "1/s"),
    Row("steps_ratio_2", "ratio", digits=2, bar="at least 3"),
    Row("decisions_1", "decisions, 1 process", "1/s"),
    Row("decisions_2", "decisions, 2 processes", "1/s"),
    Row("learned", "transitions while training, 2 workers", "1/s"),
    Row("peer_learned_1", "stable-baselines3 on `PickCube-v1`, 1 process (DummyVecEnv)", "1/s"),
    Row("peer_learned_2", "stable-baselines3 on `PickCube-v1`, 2 processes (SubprocVecEnv)", "1/s"),
    Row("learned_ratio", "ratio to the better one", digits=2, bar="at least 2"),
    Row("network_us", "decision, network alone", "us", 1, "at most 30"),
    Row("decision_us", "decision, features and network", "us", 1),
    Row("torch_difference", "largest difference to torch", digits=-1, bar="at most 1e-5"),
)


class Ours:
    """``grasp_then_pick`` in processes of its own, as `Peer` is, with actions that were decided beforehand.

    An environment is run once with the reference policy and noise, and its actions are kept; the same worlds
    with the same actions are the same episodes, and those are timed.
    """

    def __init__(self) -> None:
        self._workers: list[tuple[Any, Any]] = []
        self._environment = 0

    def rate(self, processes: int, n_envs: int) -> tuple[float, float]:
        """Control periods and decisions per second; `ROLLOUT_STEPS` decisions of each environment."""
        context = multiprocessing.get_context("fork")
        while len(self._workers) < processes:
            mine, theirs = context.Pipe()
            process = context.Process(target=_serve, args=(theirs,), daemon=True)
            process.start()
            theirs.close()
            self._workers.append((mine, process))
        pipes = [pipe for pipe, _ in self._workers[:processes]]
        for pipe in pipes:
            pipe.send(range(self._environment, self._environment + n_envs))
            self._environment += n_envs
        for pipe in pipes:
            pipe.recv()
        started = time.perf_counter()
        for pipe in pipes:
            pipe.send("again")
        periods = sum(pipe.recv() for pipe in pipes)
        spent = time.perf_counter() - started
        return periods / spent, processes * n_envs * ROLLOUT_STEPS / spent

    def close(self) -> None:
        """End the processes."""
        for pipe, process in self._workers:
            pipe.close()
            process.join(timeout=10.0)
            if process.is_alive():
                process.kill()


def _serve(pipe: Any) -> None:
    """Decide n_envs, and run them again and count their control periods, until nobody asks any more."""
    env = EpisodeEnv(grasp_then_pick.build(), grasp_then_pick.scene(), stage=2)
    network, periods, step = untrained(env.scene.robot), [0], env.batch.worlds.step

    def counted(tool: Any, hand: Any, rows: Any) -> Any:
        periods[0] += 1
        return step(tool, hand, rows)

    env.batch.worlds.step = counted  # type: ignore[method-assign]
    n_envs: list[list[tuple[int, list[Any]]]] = []
    while True:
        try:
            asked = pipe.recv()
        except EOFError:
            return
        if asked != "again":
            n_envs = [decided(env, network, environment) for environment in asked]
        periods[0] = 0
        if asked == "again":
            for episodes in n_envs:
                for seed, actions in episodes:
                    env.reset(seed=seed)
                    for action in actions:
                        env.step(action)
        pipe.send(periods[0])


def decided(env: EpisodeEnv, network: Network, environment: int) -> list[tuple[int, list[Any]]]:
    """The episodes of an environment: their seeds, and the actions of the network with noise."""
    rng = np.random.default_rng((0, environment))
    noise = rng.normal(0.0, DEVIATION, (ROLLOUT_STEPS, Grasp.actions + 1)).astype(np.float32)
    noise[:, -1] = 0.0
    episodes: list[tuple[int, list[Any]]] = []
    over = True
    for row in noise:
        if over:
            episodes.append((int(rng.integers(2**31)), []))
            features, _ = env.reset(seed=episodes[-1][0])
        action = np.clip(network(features) + row, -1.0, 1.0)
        episodes[-1][1].append(action)
        features, _, terminated, truncated, _ = env.step(action)
        over = terminated or truncated
    return episodes


def ours_learn(rollouts: int, config: TrainConfig) -> float:
    """Transitions per second of our training: rollouts and updates, without evaluations."""
    from bt_tasksim.training.ppo import train
    from bt_tasksim.training.record import Progress

    rates: list[float] = []

    def note(progress: Progress) -> None:
        rates.append(progress.rate)

    train(
        grasp_then_pick.build(),
        grasp_then_pick.scene(),
        steps=rollouts * config.rollout,
        config=config,
        workers=2,
        report=note,
    )
    return len(rates) / sum(1.0 / rate for rate in rates)


def throughput(rounds: int, n_envs: int, peer: Peer) -> dict[str, float]:
    """Steps without a learner, in turns."""
    ours = Ours()
    table: dict[str, list[float]] = {}
    try:
        ours.rate(1, 1)
        for _ in range(rounds):
            for processes in (1, 2):
                periods, decisions = ours.rate(processes, n_envs)
                _note(table, **{f"steps_{processes}": periods, f"decisions_{processes}": decisions})
                if not peer.missing:
                    other = peer.steps(processes, 150 * n_envs * processes)
                    _note(table, **{f"peer_steps_{processes}": other})
                    _note(table, **{f"steps_ratio_{processes}": periods / other})
    finally:
        ours.close()
    return {name: statistics.median(values) for name, values in table.items()}


def learning(rounds: int, rollouts: int, peer: Peer) -> dict[str, float]:
    """Transitions while training, in turns."""
    config = TrainConfig(evaluate_every=0, evaluation_draws=0)
    settings = {
        name: getattr(config, name)
        for name in ("rollout", "minibatch", "epochs", "learning_rate", "gae_lambda", "clip", "entropy")
    }
    settings |= {"hidden": list(config.hidden), "gamma": config.reward.gamma}
    table: dict[str, list[float]] = {}
    for _ in range(rounds):
        mine = ours_learn(rollouts, config)
        _note(table, learned=mine)
        if not peer.missing:
            theirs = [peer.learn(processes, rollouts, settings) for processes in (1, 2)]
            _note(table, peer_learned_1=theirs[0], peer_learned_2=theirs[1], learned_ratio=mine / max(theirs))
    return {name: statistics.median(values) for name, values in table.items()}


def inference(repeat: int, policy: str | None) -> dict[str, float]:
    """Microseconds of a decision, and the largest difference to the same network in torch."""
    env = EpisodeEnv(grasp_then_pick.build(), grasp_then_pick.scene(), stage=2)
    features, _ = env.reset(seed=0)
    if policy is None:
        from bt_tasksim.training.learner import Learner

        learner = Learner(env.observation_space, env.action_space, TrainConfig())
        learner.statistics.update(np.random.default_rng(1).normal(0.3, 1.5, (1000, len(features))))
        network = learner.network
    else:
        network, _ = load_policy(policy)
    decision = env.decision
    assert decision is not None
    model, seen, memory = decision.leaf.model, decision.seen, decision.memory
    learned = LearnedPolicy(network, "measured")
    rows = np.random.default_rng(0).normal(0.0, 2.0, (10_000, len(features))).astype(np.float32)
    ours = np.array([network(row) for row in rows])
    return {
        "network_us": 1e6 * _median_time(lambda: network(features), repeat),
        "decision_us": 1e6 * _median_time(lambda: learned.act(model, seen, memory), repeat),
        "torch_difference": float(np.abs(ours - in_torch(network, rows)).max()),
    }


def in_torch(network: Network, rows: Any) -> Any:
    """What torch makes of rows ``(k, n)`` with the same weights."""
    import torch

    x = torch.as_tensor(network.normalise(rows))
    with torch.no_grad():
        for k, (w, b) in enumerate(network.layers):
            x = torch.nn.functional.linear(x, torch.as_tensor(w), torch.as_tensor(b))
            if k < len(network.layers) - 1:
                x = torch.tanh(x)
    return x.numpy()


def _note(table: dict[str, list[float]], **values: float) -> None:
    for name, value in values.items():
        table.setdefault(name, []).append(value)


def _median_time(call: Callable[[], Any], repeat: int) -> float:
    times = []
    for _ in range(repeat):
        started = time.perf_counter()
        call()
        times.append(time.perf_counter() - started)
    return statistics.median(times)


def main(arguments: list[str] | None = None) -> int:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description="How fast one learns.")
    parser.add_argument("--quick", action="store_true", help="fewer repetitions")
    parser.add_argument("--policy", metavar="DIR", help="a policy's folder, for the cost of a decision")
    parser.add_argument("--only", nargs="*", choices=("steps", "learning", "inference"), default=[])
    parser.add_argument("--json", type=Path, default=RESULTS / "learning.json")
    options = parser.parse_args(arguments)
    quick, parts = options.quick, options.only or ("steps", "learning", "inference")
    found: dict[str, Any] = {}
    if set(parts) & {"steps", "learning"}:
        peer = Peer()
        if peer.missing:
            found["maniskill_missing"] = peer.missing
            print(f"ManiSkill PickCube-v1 did not start: {peer.missing}")
        try:
            if "steps" in parts:
                found |= throughput(3 if quick else 7, 2 if quick else 8, peer)
            if "learning" in parts:
                found |= learning(1 if quick else 3, 1 if quick else 3, peer)
        finally:
            peer.close()
    if "inference" in parts:
        found |= inference(2000 if quick else 20000, options.policy)
    for row in ROWS:
        if row.key in found:
            print(f"{row.label:64}{row.text(found[row.key]):>12}{f'   (bar: {row.bar})' if row.bar else ''}")
    if not options.only:
        write_text(options.json, json.dumps(found, indent=2) + "\n")
        print(f"wrote {options.json}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
