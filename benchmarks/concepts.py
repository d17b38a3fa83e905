"""How often each concept's scenario succeeds, and how gently.

    python -m benchmarks.concepts --block B0012                          # everything: hours
    python -m benchmarks.concepts --only push slide --engines mujoco     # a look, on development seeds
    python -m benchmarks.concepts --only make_room pour_a_cup --engines twin --episodes 6

For every ready-made scenario, with the Panda in SAPIEN and in MuJoCo and with the Ability hand in SAPIEN:
how many of a hundred draws succeed, judged by the physics state, and why the others do not; and of the same
runs the force at the wrist, how the tool is jerked, and the deepest overlap, beside the limits that
docs/concepts.md states. On the twin (``--engines twin``), over ROS and in real time, only how many succeed
(`benchmarks.concepts_twin`). Writes ``concept-<scenario>-<robot>-<engine>.json``: of a block to its folder in
``benchmarks/results``, of other seeds to ``runs/benchmarks``. What a block has of a row already is left
alone, so that a call that was broken off goes on where it was.
"""

from __future__ import annotations

import argparse
import itertools
import multiprocessing
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks import sealed
from benchmarks.concepts_twin import TwinOfScenarios
from bt_tasksim.core.errors import BtTasksimError
from bt_tasksim.core.identity import identity
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.batch_runner import BatchRunner, BatchStep
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.result import Result
from bt_tasksim.training.evaluation import of_batch
from bt_tasksim.training.evaluation_outcomes import Evaluation
from bt_tasksim.training.named_tree import NamedTree
from bt_tasksim.trees.load import scenarios

CIRCUMSTANCES = (("panda", "sapien"), ("panda", "mujoco"), ("xarm7_ability", "sapien"))
"""Robots and physics engines."""
TWIN = "twin"
"""Stands for the twin among the engines; measured where it is asked for."""
EPISODES = 100
"""Draws."""
WORLDS = 50
"""That run at once."""
USUAL = 0.95
"""Share of the ticks within which a jerk counts as usual, and of the runs that have to keep a limit."""
LIMITS = {"force": 60.0, "jerk": 40.0, "overlap": 0.002}
"""What is gentle enough: newtons at the wrist, m/s^3 of the tool, metres of overlap, see docs/concepts.md."""


@dataclass(frozen=True)
class Row:
    """A scenario with a robot in an engine."""

    scenario: str
    robot: str
    engines: str

    @property
    def name(self) -> str:
        """Name of its results file."""
        return f"concept-{self.scenario}-{self.robot}-{self.engines}"


class Feeler:
    """What the robots of a batch felt and did; give it to `BatchRunner.run` as ``record``.

    Attributes:
        force: Largest force at the wrist by seed, N.
        tool: Positions of the tool at each tick by seed, metres.
    """

    def __init__(self) -> None:
        self.force: dict[int, float] = {}
        self.tool: dict[int, list[Array]] = {}

    def __call__(self, step: BatchStep) -> None:
        """Keep one tick."""
        forces = np.linalg.norm(step.observation.wrench[step.rows, :3], axis=1)
        places = np.array(step.observation.tool_pose[step.rows, :3])
        for seed, force, place in zip(step.seeds, forces.tolist(), places, strict=True):
            self.force[seed] = max(self.force.get(seed, 0.0), force)
            self.tool.setdefault(seed, []).append(place)

    def jerk(self, seed: int, period: float) -> float:
        """What `USUAL` of the tool's jerks do not exceed, m/s^3, by third differences over ticks."""
        places = np.array(self.tool.get(seed, []))
        if len(places) < 4:
            return 0.0
        return float(np.quantile(np.linalg.norm(np.diff(places, n=3, axis=0), axis=1) / period**3, USUAL))


def measure(row: Row, seeds: Sequence[int]) -> dict[str, Any]:
    """What is kept of one row."""
    options, began = EngineOptions(engines=row.engines), time.perf_counter()
    source, feeler = NamedTree(row.scenario, None, row.robot).load(options), Feeler()
    ended: dict[int, Result | BtTasksimError] = {}
    with BatchRunner(source.build, source.scene, options, min(WORLDS, len(seeds))) as runner:
        ended.update(runner.run(seeds, record=feeler))
        policies, period = runner.policies, runner.context.world.control_period
    outcomes = {seed: of_batch(seed, ended[seed]) for seed in seeds}
    found = Evaluation(
        scenario=row.scenario,
        robot=row.robot,
        engines=row.engines,
        perception="state",
        policies=policies,
        outcomes=tuple(outcomes.values()),
        seconds=time.perf_counter() - began,
        asked=len(seeds),
        versions=identity(),
    )
    felt = {
        "force": feeler.force,
        "jerk": {seed: feeler.jerk(seed, period) for seed in feeler.tool},
        "overlap": {seed: o.penetration for seed, o in outcomes.items() if not np.isnan(o.penetration)},
    }
    rough = {seed for what, values in felt.items() for seed in values if values[seed] > LIMITS[what]}
    kept = {k: v for k, v in found.to_json().items() if k not in ("outcomes", "seconds", "sha256", "subject")}
    reasons = Counter(f"{o.leaf}: {o.reason}" for o in outcomes.values() if not o.success)
    gentle = {what: _gentle(list(values.values()), LIMITS[what]) for what, values in felt.items() if values}
    kept |= {
        "first_seed": seeds[0],
        "reasons": dict(reasons.most_common()),
        "gentle": len(seeds) - len(rough),
    }
    return {**kept, **gentle}


def _gentle(values: Sequence[float], limit: float) -> dict[str, Any]:
    """How large something was in runs, and in how many within its limit."""
    numbers = np.median(values), np.quantile(values, USUAL), max(values)
    named = dict(zip(("median", "usual", "largest"), (round(float(n), 5) for n in numbers), strict=True))
    return {**named, "limit": limit, "within": int(np.sum(np.array(values) <= limit)), "of": len(values)}


def main(arguments: list[str] | None = None) -> int:
    """Measure the rows that are asked for."""
    parser = argparse.ArgumentParser(description="Success and gentleness of every concept's scenario.")
    sealed.add_arguments(parser)
    known = scenarios()
    parser.add_argument("--only", nargs="*", default=known, choices=known, metavar="SCENARIO")
    parser.add_argument("--robots", nargs="*", default=sorted({r for r, _ in CIRCUMSTANCES}))
    usual = sorted({e for _, e in CIRCUMSTANCES})
    parser.add_argument("--engines", nargs="*", default=usual, choices=[*usual, TWIN])
    parser.add_argument("--episodes", type=int, default=EPISODES, metavar="N")
    parser.add_argument("--workers", type=int, default=2, help="rows that are measured side by side")
    options = parser.parse_args(arguments)
    rows = [
        Row(scenario, robot, engines)
        for scenario, (robot, engines) in itertools.product(options.only, (*CIRCUMSTANCES, ("panda", TWIN)))
        if robot in options.robots and engines in options.engines
    ]
    try:
        todo = {row: seeds for row in rows if (seeds := _seeds(row, options)) is not None}
    except BtTasksimError as error:
        print(f"concepts: {error}", file=sys.stderr)
        return 2
    simulated = {row: seeds for row, seeds in todo.items() if row.engines != TWIN}
    real_time = {row: seeds for row, seeds in todo.items() if row.engines == TWIN}
    return max(_simulated(simulated, options), _on_the_twin(real_time, options))


def _simulated(todo: Mapping[Row, Sequence[int]], options: argparse.Namespace) -> int:
    """Rows side by side; the exit code."""
    if options.workers == 1 or not todo:
        return max((_kept(row, seeds, options.block) for row, seeds in todo.items()), default=0)
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(options.workers, spawn, max_tasks_per_child=1) as pool:
        asked = [pool.submit(_kept, row, seeds, options.block) for row, seeds in todo.items()]
    return max((each.result() for each in asked), default=0)


def _on_the_twin(todo: Mapping[Row, Sequence[int]], options: argparse.Namespace) -> int:
    """Rows one after the other, in real time; the exit code."""
    with TwinOfScenarios() as twin:

        def measured(row: Row, seeds: Sequence[int]) -> dict[str, Any]:
            found = twin.measure(row.scenario, row.robot, seeds)
            return {"versions": identity(), "first_seed": seeds[0], **found}

        return max((_kept(row, seeds, options.block, measured) for row, seeds in todo.items()), default=0)


def _measure_of(row: Row) -> str:
    return f"concepts/{row.name}"


def _seeds(row: Row, options: argparse.Namespace) -> range | None:
    """Draws of a row; None where a block has it already."""
    if options.block is not None and sealed.result_file(options.block, _measure_of(row)).exists():
        print(f"{row.name:45} is measured")
        return None
    return sealed.choose(options.block, options.seed, _measure_of(row), options.episodes)


def _kept(
    row: Row,
    seeds: Sequence[int],
    block: str | None,
    measured: Callable[[Row, Sequence[int]], dict[str, Any]] = measure,
) -> int:
    """Measure, keep and print a row; the exit code."""
    try:
        found = measured(row, seeds)
        sealed.keep(block, _measure_of(row), found)
    except BtTasksimError as error:
        print(f"concepts: {row.name}: {error}", file=sys.stderr, flush=True)
        return 2
    said = f"{row.name:45} {found['successes']:4d} of {found['episodes']}   "
    if "force" in found:
        force, jerk, overlap = (found.get(what, {}) for what in ("force", "jerk", "overlap"))
        said += (
            f"wrist {force.get('usual', 0):.0f} N, jerk {jerk.get('usual', 0):.0f} m/s^3, "
            f"overlap {1000 * overlap.get('usual', 0):.1f} mm  "
        )
    print(f"{said}{found['reasons']}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
