"""The same trees and policies in SAPIEN, in MuJoCo and on the twin over ROS, on the same draws.

``python -m benchmarks.gap --episodes 100 --block B0000`` runs `pick_and_throw` and `shelf_to_shelf`, each
with the programmed and with the learned grasp, prints a table with 95 % intervals, and writes each row to a
file ``gap-<scenario>-<grasp>-<engines>.json``, so that several calls can measure parts of it: of a block
(`benchmarks.sealed`) to its folder in ``benchmarks/results``, of other seeds to ``runs/benchmarks``. On the
twin, success is judged by its own hidden state, read through the evaluation channel after the run; the run
is in real time (about ten seconds an episode), in the other two as fast as it goes.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from benchmarks import sealed
from benchmarks.faults import bench_of
from bt_tasksim.core.errors import BtTasksimError
from bt_tasksim.core.outcomes import outcome_of_error
from bt_tasksim.core.world import Hidden
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import QUIET, SETTLE, Runner
from bt_tasksim.hardware.twin.evaluation import EvaluationClient
from bt_tasksim.scene.success import Overlap, at_rest, evaluate_success
from bt_tasksim.training.evaluation import Job, evaluate
from bt_tasksim.training.evaluation_outcomes import wilson
from bt_tasksim.trees.load import load_source

SCENARIOS = ("pick_and_throw", "shelf_to_shelf")
GRASPS = {"programmed": (("Grasp", "programmed"),), "learned": (("Grasp", "grasp-panda"),)}
ENGINES = ("sapien", "mujoco", "twin")
CAMERA = "twin-camera"
"""The twin with perception by its camera instead of tracked poses; measured where it is asked for."""


@dataclass(frozen=True)
class Episode:
    """One episode, in short: whether it succeeded, a countable reason where not, and a sentence."""

    seed: int
    success: bool
    reason: str
    why: str


def in_process(scenario: str, grasp: str, engines: str, seeds: Sequence[int]) -> list[Episode]:
    """Episodes of a simulation in this process."""
    job = Job(scenario, options=EngineOptions(engines=engines), policies=GRASPS[grasp])
    found = evaluate(job, seeds)
    return [Episode(o.seed, o.success, o.reason, o.why) for o in found.outcomes]


def on_the_twin(
    scenario: str, grasp: str, seeds: Sequence[int], domain: int, camera: bool = False
) -> list[Episode]:
    """Episodes over ROS, judged by the twin's own truth."""
    source = load_source(scenario, policies=GRASPS[grasp])
    with bench_of(domain, camera=camera) as bench:
        perception = "camera" if camera else "state"
        options = EngineOptions(engines=f"ros:127.0.0.1:{bench.twin.port}", perception=perception)
        runner = Runner(source.build(), source.scene, options)
        try:
            return [_one(runner, bench.evaluation, seed) for seed in seeds]
        finally:
            runner.close()


def _one(runner: Runner, evaluation: EvaluationClient, seed: int) -> Episode:
    found = judged_by_truth(runner, evaluation, seed)
    return Episode(seed, found.success, found.reason, found.why)


@dataclass(frozen=True)
class Judged:
    """A run on the twin: its status, the leaf that failed, and what its own hidden state says of it."""

    success: bool
    status: str
    leaf: str
    reason: str
    why: str


def judged_by_truth(
    runner: Runner, evaluation: EvaluationClient, seed: int, stream: str = "evaluation"
) -> Judged:
    """One run on the twin, in the world that this seed draws."""
    configuration, robot = runner.scene.sample(seed, stream), runner.robot
    evaluation.load(configuration, seed)
    try:
        result = runner.run(seed, stream)
        status, leaf, reason, why = result.status.name, result.leaf, result.reason, result.why
    except BtTasksimError as error:
        outcome = outcome_of_error(error)
        status, leaf, reason, why = "INVALID", "", outcome.cause.reason.name, outcome.sentence
    truth, overlap = _settled(evaluation)
    model = configuration.world_model([tip.name for tip in robot.tips], robot.opening)
    verdict = evaluate_success(configuration, model, truth, overlap=overlap)
    if status == "SUCCESS":
        reason, why = verdict.reason, verdict.why
    return Judged(status == "SUCCESS" and verdict.success, status, leaf, reason, why)


def _settled(evaluation: EvaluationClient) -> tuple[Hidden, Overlap | None]:
    """The truth once things have come to rest, or have not for as long as a simulation would wait."""
    end, quiet = time.monotonic() + SETTLE, 0
    while True:
        truth, overlap = evaluation.truth()
        quiet = quiet + 1 if at_rest(truth.velocities) else 0
        if quiet >= QUIET or time.monotonic() > end:
            return truth, overlap
        time.sleep(0.05)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=5)
    sealed.add_arguments(parser)
    parser.add_argument("--scenarios", nargs="*", default=list(SCENARIOS), choices=SCENARIOS)
    parser.add_argument("--grasps", nargs="*", default=list(GRASPS), choices=GRASPS)
    parser.add_argument("--engines", nargs="*", default=list(ENGINES), choices=[*ENGINES, CAMERA])
    parser.add_argument("--domain", type=int, default=45)
    options = parser.parse_args(arguments)
    try:
        _measure_all(options)
    except BtTasksimError as error:
        print(f"gap: {error}", file=sys.stderr)
        return 2
    return 0


def _measure_all(options: argparse.Namespace) -> None:
    names = [
        f"gap/gap-{scenario}-{grasp}-{engines}"
        for scenario in options.scenarios
        for grasp in options.grasps
        for engines in options.engines
    ]
    for name in names:  # what cannot be measured is refused before anything is
        seeds = sealed.choose(options.block, options.seed, name, options.episodes)
    print("| scenario | grasp | engines | success | 95 % interval | failures |")
    print("|---|---|---|---|---|---|")
    for name in names:
        scenario, grasp, engines = name.removeprefix("gap/gap-").split("-", 2)
        row = _row(scenario, grasp, engines, _episodes(scenario, grasp, engines, seeds, options.domain))
        print(_line(row), flush=True)
        sealed.keep(options.block, name, row)


def _episodes(scenario: str, grasp: str, engines: str, seeds: Sequence[int], domain: int) -> list[Episode]:
    if engines in ("twin", CAMERA):
        return on_the_twin(scenario, grasp, seeds, domain, engines == CAMERA)
    return in_process(scenario, grasp, engines, seeds)


def _row(scenario: str, grasp: str, engines: str, episodes: list[Episode]) -> dict[str, Any]:
    successes = sum(e.success for e in episodes)
    return {
        "scenario": scenario,
        "grasp": grasp,
        "engines": engines,
        "episodes": len(episodes),
        "successes": successes,
        "confidence_interval": list(wilson(successes, len(episodes))),
        "failures": dict(Counter(e.reason for e in episodes if not e.success).most_common()),
        "outcomes": [asdict(e) for e in episodes],
    }


def _line(row: dict[str, Any]) -> str:
    low, high = row["confidence_interval"]
    failures = ", ".join(f"{n} x {reason}" for reason, n in row["failures"].items())
    return (
        f"| {row['scenario']} | {row['grasp']} | {row['engines']} | {row['successes']} of {row['episodes']} "
        f"| {100 * low:.0f} to {100 * high:.0f} % | {failures} |"
    )


if __name__ == "__main__":
    sys.exit(main())
