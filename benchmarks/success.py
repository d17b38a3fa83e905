"""How often: every success rate that the documentation quotes.

    python -m benchmarks.success --block B0000   # everything: minutes, and an hour for the cameras
    python -m benchmarks.success --only shelf_to_shelf-panda    # a look, on development seeds

Writes ``<scenario>-<robot>[-camera][-fromlogs].json``, as ``bt-tasksim evaluate --json`` would: of a block
(`benchmarks.sealed`) to its folder in ``benchmarks/results``, of other seeds to ``runs/benchmarks``. For
``-fromlogs`` the ten shipped logs of a scenario become ten trees, and each runs on thirty of the three
hundred seeds on which the authored tree runs: the two files are paired seed by seed.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks import sealed
from bt_tasksim.core.errors import BtTasksimError
from bt_tasksim.core.resources import asset
from bt_tasksim.demos_decomp import decompose_log, open_log
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.training.evaluation import Job, evaluate
from bt_tasksim.training.evaluation_outcomes import Evaluation
from bt_tasksim.trees.from_graph import tree_from_graph
from bt_tasksim.trees.xml_writer import save_tree

RESULTS = Path(__file__).parent / "results"
SCENARIOS = ("pick_and_place", "shelf_to_shelf", "pick_and_throw")


@dataclasses.dataclass(frozen=True)
class Row:
    """One row of the tables."""

    scenario: str
    robot: str = "panda"
    perception: str = "state"
    episodes: int = 300
    from_logs: bool = False

    @property
    def name(self) -> str:
        """Name of its results file."""
        camera = "-camera" if self.perception == "camera" else ""
        return f"{self.scenario}-{self.robot}{camera}{'-fromlogs' if self.from_logs else ''}"


ROWS = (
    *(Row(s) for s in SCENARIOS),
    Row("pick_and_place", "xarm7_ability"),
    Row("pick_and_place_recovering"),
    *(Row(s, from_logs=True) for s in SCENARIOS),
    *(Row(s, perception="camera", episodes=50) for s in SCENARIOS),
)


def main(arguments: list[str] | None = None) -> int:
    """Measure the rows that are asked for."""
    parser = argparse.ArgumentParser(description="Success rates.")
    sealed.add_arguments(parser)
    parser.add_argument(
        "--only",
        nargs="*",
        default=[],
        choices=[r.name for r in ROWS],
        metavar="ROW",
        help=", ".join(r.name for r in ROWS),
    )
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--episodes", type=int, metavar="N", help="most episodes of a row, for a look")
    options = parser.parse_args(arguments)
    try:
        for row in ROWS:
            if not options.only or row.name in options.only:
                _one(row, options)
    except BtTasksimError as error:
        print(f"success: {error}", file=sys.stderr)
        return 2
    return 0


def _one(row: Row, options: argparse.Namespace) -> None:
    name, episodes = f"success/{row.name}", min(options.episodes or row.episodes, row.episodes)
    seeds = sealed.choose(options.block, options.seed, name, episodes)
    found = content(measure(row, seeds, options.workers), seeds.start)
    sealed.keep(options.block, name, found)
    print(f"{row.name:45} {found['successes']:4d} of {found['episodes']}  {found['failures']}", flush=True)


def content(found: Evaluation, first_seed: int) -> dict[str, Any]:
    """What is kept of an evaluation."""
    kept = {k: v for k, v in found.to_json().items() if k not in ("outcomes", "seconds")}
    return {**kept, "first_seed": first_seed}


def measure(row: Row, seeds: Sequence[int], workers: int) -> Evaluation:
    """The evaluation of one row."""
    options = EngineOptions(perception=row.perception)
    if not row.from_logs:
        return evaluate(Job(row.scenario, robot=row.robot, options=options), seeds, workers)
    logs = sorted(asset("demonstrations", row.scenario).glob("*.h5"))[: len(seeds)]
    share = len(seeds) // len(logs)
    parts = []
    with tempfile.TemporaryDirectory() as folder:
        for k, log in enumerate(logs):
            path = Path(folder) / f"{log.stem}.xml"
            save_tree(tree_from_graph(decompose_log(open_log(log)).graph, log.stem), path, scene=row.scenario)
            job = Job(str(path), robot=row.robot, options=options)
            parts.append(evaluate(job, seeds[k * share : (k + 1) * share], workers))
    return dataclasses.replace(
        parts[0],
        scenario=row.scenario,
        outcomes=tuple(o for part in parts for o in part.outcomes),
        seconds=sum(part.seconds for part in parts),
    )


if __name__ == "__main__":
    sys.exit(main())
