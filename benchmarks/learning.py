"""How fast one learns: ratios within one run, in turns, medians over rounds.

    python -m benchmarks.learning            # some minutes, on an idle machine
    python -m benchmarks.learning --quick

1. Environment steps per second without a learner: ``grasp_then_pick``, whole episodes with resets and what
   follows, in an `EpisodeVectorEnv` of 64 worlds, against ManiSkill's ``PickCube-v1``; both with actions that
   were decided beforehand, 100 Hz physics and 20 Hz control, one step being one control period; in one and in
   two processes.
2. Transitions per second that a learner gets: our `train` with two workers against stable-baselines3 PPO on
   ``PickCube-v1`` with the same network, rollout, minibatch and epochs, the better of one process and two. A
   transition of ours is a decision: control periods before the approach and during the pick come on top.
3. What a decision costs on the robot: the network, and with its features; and how far it is from torch.

Writes ``benchmarks/results/learning.json``.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasp import untrained
from benchmarks.peer_maniskill import Peer
from benchmarks.success import RESULTS
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.core.files import write_text
from bt_tasksim.core.poses import Array
from bt_tasksim.core.workers import Workers
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import LearnedPolicy, load_policy
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.env import EpisodeEnv
from bt_tasksim.training.vector_env import EpisodeVectorEnv
from bt_tasksim.trees.scenarios import grasp_then_pick

WORLDS = 64
"""Worlds of a process, where there is no learner."""
DECISIONS = 128
"""Decisions of each that are kept, some two episodes."""
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
    Row("learned_ratio", "ratio to the better one", digits=2, bar="at least 5"),
    Row("network_us", "decision, network alone", "us", 1, "at most 30"),
    Row("decision_us", "decision, features and network", "us", 1),
    Row("torch_difference", "largest difference to torch", digits=-1, bar="at most 1e-5"),
)


class Kept:
    """Worlds of ``grasp_then_pick``, and what was decided in them beforehand.

    They are run once with a simple policy and noise, and its actions are kept; the same worlds with the same
    actions are the same episodes, and those are timed.
    """

    def __init__(self) -> None:
        self._envs = EpisodeVectorEnv(grasp_then_pick.build(), grasp_then_pick.scene(), WORLDS, stage=2)
        self._network = untrained(self._envs.batch.scene.robot)
        self._seed = 0
        self._actions: list[list[Array]] = []
        worlds, self._periods = self._envs.batch.worlds, 0
        step = worlds.step

        def counted(tool: Any, hand: Any, rows: Array) -> Any:
            self._periods += len(rows)
            return step(tool, hand, rows)

        worlds.step = counted  # type: ignore[method-assign]

    def decide(self, seed: int) -> None:
        """Choose the actions of episodes whose worlds are drawn with a seed."""
        self._seed, self._actions = seed, [[] for _ in range(WORLDS)]
        rng = np.random.default_rng(seed)
        noise = rng.normal(0.0, DEVIATION, (WORLDS, DECISIONS, Grasp.actions + 1)).astype(np.float32)
        noise[..., -1] = 0.0

        def action(row: int, output: Array) -> Array:
            self._actions[row].append(np.clip(output + noise[row, len(self._actions[row])], -1.0, 1.0))
            return self._actions[row][-1]

        def decide(rows: list[int], seen: Array) -> Array:
            return np.stack([action(*both) for both in zip(rows, self._network(seen), strict=True)])

        self._play(decide)

    def again(self) -> tuple[int, int, float]:
        """The same once more: control periods, decisions and seconds, until a world has had its last one."""
        done = [0] * WORLDS

        def next_of(row: int) -> Array:
            done[row] += 1
            return self._actions[row][done[row] - 1]

        self._periods, started = 0, time.perf_counter()
        self._play(lambda rows, _: np.stack([next_of(row) for row in rows]))
        return self._periods, sum(done), time.perf_counter() - started

    def _play(self, decide: Callable[[list[int], Array], Array]) -> None:
        """Go on until a world has had all its decisions."""
        most = [0] * WORLDS
        self._envs.begin(np.arange(WORLDS), self._seed * WORLDS)
        while max(most) < DECISIONS:
            rows, ready = self._envs.recv()
            self._envs.send(rows, decide(rows.tolist(), ready.features))
            for row in rows.tolist():
                most[row] += 1


def decide(kept: Kept, seeds: Sequence[int], /) -> Iterator[tuple[int, None]]:
    """Work for a fleet: choose the actions of episodes."""
    for index, seed in enumerate(seeds):
        yield index, kept.decide(seed)


def again(kept: Kept, numbers: Sequence[int], /) -> Iterator[tuple[int, tuple[int, int, float]]]:
    """Work for a fleet: control periods, decisions and seconds of the same once more."""
    for index in range(len(numbers)):
        yield index, kept.again()


class Ours:
    """Processes with worlds of ``grasp_then_pick``, as `Peer` is one with ManiSkill's."""

    def __init__(self) -> None:
        self._fleets = {processes: Workers(Kept, processes) for processes in (1, 2)}
        self._seed = 0

    def rate(self, processes: int) -> tuple[float, float]:
        """Control periods and decisions per second, of all processes together."""
        fleet, seeds = self._fleets[processes], range(self._seed, self._seed + processes)
        self._seed += processes
        list(fleet.spread(decide, seeds))  # each process takes one
        found = [result for _, result in fleet.spread(again, seeds)]
        return sum(n / t for n, _, t in found), sum(n / t for _, n, t in found)

    def close(self) -> None:
        """End the processes."""
        for fleet in self._fleets.values():
            fleet.close()


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


def throughput(rounds: int, steps: int, peer: Peer) -> dict[str, float]:
    """Steps without a learner, in turns."""
    ours = Ours()
    table: dict[str, list[float]] = {}
    try:
        for processes in (1, 2):
            ours.rate(processes)
        for _ in range(rounds):
            for processes in (1, 2):
                periods, decisions = ours.rate(processes)
                _note(table, **{f"steps_{processes}": periods, f"decisions_{processes}": decisions})
                if not peer.missing:
                    other = peer.steps(processes, steps * processes)
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
                found |= throughput(1 if quick else 7, 300 if quick else 1200, peer)
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
