"""How often: every success rate that the documentation quotes, on seeds that were not used while building.

    python -m benchmarks.success        # everything: minutes, and an hour for the cameras
    python -m benchmarks.success --only shelf_to_shelf-panda

Writes ``benchmarks/results/<scenario>-<robot>[-camera][-fromlogs].json``, as ``bt-tasksim evaluate --json``
would. For ``-fromlogs`` the ten shipped logs of a scenario become ten trees, and each runs on thirty of the
three hundred seeds on which the authored tree runs: the two files are paired seed by seed.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import tempfile
from pathlib import Path

from bt_tasksim.engines.registry import EngineOptions
from bt_tasksim.files import write_text
from bt_tasksim.resources import asset
from bt_tasksim.training.evaluation import Evaluation, Job, evaluate
from demos_decomp import decompose_log, open_log
from trees.from_graph import tree_from_graph
from trees.xml_writer import save_tree

FIRST_SEED = 50_000
"""Seeds from here on were never run while concepts, engines or scenes were changed."""
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
    parser = argparse.ArgumentParser(description="Success rates on fresh seeds.")
    parser.add_argument("--only", nargs="*", default=[], metavar="ROW", help=", ".join(r.name for r in ROWS))
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args(arguments)
    RESULTS.mkdir(exist_ok=True)
    for row in ROWS:
        if options.only and row.name not in options.only:
            continue
        found = measure(row, options.workers).to_json()
        found.pop("outcomes")
        write_text(RESULTS / f"{row.name}.json", json.dumps(found, indent=2) + "\n")
        print(
            f"{row.name:45} {found['successes']:4d} of {found['episodes']}  {found['failures']}", flush=True
        )
    return 0


def measure(row: Row, workers: int) -> Evaluation:
    """The evaluation of one row."""
    options = EngineOptions(perception=row.perception)
    seeds = range(FIRST_SEED, FIRST_SEED + row.episodes)
    if not row.from_logs:
        return evaluate(Job(row.scenario, robot=row.robot, options=options), seeds, workers)
    logs = sorted(asset("demonstrations", row.scenario).glob("*.h5"))
    share = row.episodes // len(logs)
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
