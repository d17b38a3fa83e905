"""How often each concept's scenario succeeds, and how gently.

    python -m benchmarks.concepts --block B0011                          # everything: hours
    python -m benchmarks.concepts --only push slide --engines mujoco     # a look, on development seeds

For every ready-made scenario, with the Panda in SAPIEN and in MuJoCo and with the Ability hand in SAPIEN:
how many of a hundred draws succeed, judged by the physics state, and why the others do not; and of the first
ten, run by themselves, the force at the wrist, how the tool is jerked, and the deepest overlap. Writes
``concept-<scenario>-<robot>-<engine>.json``: of a block to its folder in ``benchmarks/results``, of other
seeds to ``runs/benchmarks``.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks import sealed
from bt_tasksim.core.errors import BtTasksimError
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner, Step
from bt_tasksim.training.evaluation import Job, evaluate
from bt_tasksim.training.named_tree import NamedTree
from bt_tasksim.trees.load import scenarios

CIRCUMSTANCES = (("panda", "sapien"), ("panda", "mujoco"), ("xarm7_ability", "sapien"))
"""Robots and physics engines."""
EPISODES, FELT = 100, 10
"""Draws that are counted, and the first so many that are looked at closely."""
USUAL = 0.95
"""Share of the ticks within which a jerk counts as usual."""


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
    """What a robot felt and did in one run; give it to `Runner.run` as ``record``.

    Attributes:
        force: Largest force at the wrist so far, N.
        tool: Positions ``(3,)`` of the tool at each tick, metres.
    """

    def __init__(self) -> None:
        self.force, self.tool = 0.0, list[Array]()
        self._time = -1.0

    def __call__(self, step: Step) -> None:
        """Keep one tick."""
        seen = step.observation
        if float(seen.time) <= self._time:
            self.force, self.tool = 0.0, []  # a new episode
        self._time = float(seen.time)
        self.force = max(self.force, float(np.linalg.norm(np.asarray(seen.wrench)[:3])))
        self.tool.append(np.array(seen.tool_pose[:3]))

    def jerk(self, period: float) -> float:
        """What `USUAL` of the tool's jerks do not exceed, m/s^3, by third differences over ticks."""
        if len(self.tool) < 4:
            return 0.0
        jerks = np.linalg.norm(np.diff(np.array(self.tool), n=3, axis=0), axis=1) / period**3
        return float(np.quantile(jerks, USUAL))


def felt(row: Row, seeds: Sequence[int]) -> dict[str, Any]:
    """Force, jerk and overlap in runs one by one: median and largest."""
    options = EngineOptions(engines=row.engines)
    source = NamedTree(row.scenario, None, row.robot).load(options)
    runner, feeler = Runner(source.build(), source.scene, options), Feeler()
    forces, jerks, overlaps = [], [], []
    try:
        for seed in seeds:
            try:
                result = runner.run(seed, record=feeler)
            except BtTasksimError:
                continue
            forces.append(feeler.force)
            jerks.append(feeler.jerk(1.0 / result.configuration.control_frequency))
            overlaps.append(0.0 if result.verdict is None else result.verdict.penetration)
    finally:
        runner.close()
    several = {"force": forces, "jerk": jerks, "overlap": overlaps}
    return {
        name: {"median": round(float(np.median(found)), 5), "largest": round(max(found), 5)}
        for name, found in several.items()
        if found
    }


def measure(row: Row, seeds: range, workers: int) -> dict[str, Any]:
    """What is kept of one row."""
    job = Job(row.scenario, robot=row.robot, options=EngineOptions(engines=row.engines))
    found = evaluate(job, seeds, workers)
    kept = {k: v for k, v in found.to_json().items() if k not in ("outcomes", "seconds")}
    reasons = Counter(f"{o.leaf}: {o.outcome.cause.reason.name}" for o in found.outcomes if not o.success)
    return {
        **kept,
        "first_seed": seeds.start,
        "reasons": dict(reasons.most_common()),
        **felt(row, seeds[:FELT]),
    }


def main(arguments: list[str] | None = None) -> int:
    """Measure the rows that are asked for."""
    parser = argparse.ArgumentParser(description="Success and gentleness of every concept's scenario.")
    sealed.add_arguments(parser)
    known = scenarios()
    parser.add_argument("--only", nargs="*", default=known, choices=known, metavar="SCENARIO")
    parser.add_argument("--robots", nargs="*", default=sorted({r for r, _ in CIRCUMSTANCES}))
    parser.add_argument("--engines", nargs="*", default=sorted({e for _, e in CIRCUMSTANCES}))
    parser.add_argument("--episodes", type=int, default=EPISODES, metavar="N")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args(arguments)
    try:
        for scenario, (robot, engines) in itertools.product(options.only, CIRCUMSTANCES):
            if robot in options.robots and engines in options.engines:
                _one(Row(scenario, robot, engines), options)
    except BtTasksimError as error:
        print(f"concepts: {error}", file=sys.stderr)
        return 2
    return 0


def _one(row: Row, options: argparse.Namespace) -> None:
    name = f"concepts/{row.name}"
    seeds = sealed.choose(options.block, options.seed, name, options.episodes)
    found = measure(row, seeds, options.workers)
    sealed.keep(options.block, name, found)
    force, jerk, overlap = (found.get(what, {}) for what in ("force", "jerk", "overlap"))
    print(
        f"{row.name:45} {found['successes']:4d} of {found['episodes']}   "
        f"wrist {force.get('largest', 0):.0f} N, jerk {jerk.get('largest', 0):.0f} m/s^3, "
        f"overlap {1000 * overlap.get('largest', 0):.1f} mm  "
        f"{found['reasons']}",
        flush=True,
    )


if __name__ == "__main__":
    sys.exit(main())
