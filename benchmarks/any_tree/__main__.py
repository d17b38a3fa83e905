"""Any tree: random tasks of one to five objects, trees made in the obvious way, and what becomes of them.

    python -m benchmarks.any_tree --robot panda --episodes 60              # development seeds
    python -m benchmarks.any_tree --robot panda --episodes 500 --block B0003
    python -m benchmarks.any_tree --only 900012 --oracle 0                 # one of them again

Each draw is a task of its own (`benchmarks.any_tree.tasks`). The draws that fail are given to an oracle with
full knowledge and a minute of planning (`benchmarks.any_tree.oracle`), and those that it finds impossible do
not count. Results are kept draw by draw, and the same command goes on where it was stopped. Of a block they
go to its folder once all draws are there.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from benchmarks import sealed
from benchmarks.any_tree.episodes import Conditions, play_one, player_of
from benchmarks.any_tree.report import lines, summary
from benchmarks.any_tree.settings import SETTINGS
from benchmarks.any_tree.trees import TREES
from bt_tasksim import EngineOptions
from bt_tasksim.core.errors import BtTasksimError, BtTasksimWarning, InputError
from bt_tasksim.core.files import write_text
from bt_tasksim.core.identity import identity

FIRST = 900_000
"""The first seed without a block."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure."""
    parser = argparse.ArgumentParser(prog="benchmarks.any_tree", description=__doc__.partition("\n")[0])
    sealed.add_arguments(parser, FIRST)
    parser.add_argument("--robot", default="panda", choices=SETTINGS)
    parser.add_argument("--episodes", type=int, default=20, metavar="N", help="draws, default 20")
    parser.add_argument(
        "--only", type=int, nargs="+", metavar="SEED", help="these seeds, and nothing is kept"
    )
    parser.add_argument("--tree", default="obvious", choices=TREES)
    parser.add_argument("--grasp", metavar="POLICY", help="policy of the grasps, default the pinned one")
    parser.add_argument("--engines", default="sapien")
    parser.add_argument("--twin", action="store_true", help="on the twin, over ROS and in real time")
    parser.add_argument("--noise", default="fine")
    parser.add_argument("--perception", default="state")
    parser.add_argument("--colours", type=int, default=0, metavar="N", help="objects in N colours alone")
    parser.add_argument("--ros", default="", metavar="FILE", help="a robot's topics, for engines over ROS")
    parser.add_argument("--stream", default="evaluation", help="stream of the draws")
    parser.add_argument("--oracle", type=float, default=60.0, metavar="S", help="seconds for a failed draw")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes, default 1")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write all results there")
    parser.add_argument("--name", default="", help="name of the measurement, default from the conditions")
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore", BtTasksimWarning)
    engines = EngineOptions(
        engines=options.engines, perception=options.perception, noise=options.noise, ros=options.ros
    )
    with tempfile.TemporaryDirectory(prefix="any_tree_") as folder:
        asked = Conditions(
            options.robot,
            options.tree,
            options.grasp,
            engines,
            Path(folder),
            options.stream,
            options.oracle,
            options.twin,
            options.colours,
        )
        try:
            if options.only:
                sealed.check_looked_at(options.only, _measure_name(asked, options))
                draws = list(_shown(_played(asked, options.only, options.workers)))
                print("\n".join(lines(draws, asked.robot)))
                return 0
            return _measure(asked, options)
        except BtTasksimError as error:
            print(f"any_tree: {error}", file=sys.stderr)
            return 2


def _measure_name(asked: Conditions, options: argparse.Namespace) -> str:
    """Under which name a result is kept."""
    return f"any_tree/{options.name or _name(asked)}"


def _measure(asked: Conditions, options: argparse.Namespace) -> int:
    measure = _measure_name(asked, options)
    seeds = sealed.choose(options.block, options.seed, measure, options.episodes)
    about = {**asked.to_data(), "oracle": asked.oracle, "block": options.block, "versions": identity()}
    kept = sealed.OUT / f"{measure.replace('/', '-')}-{options.block or seeds.start}.jsonl"
    found = _resumed(kept, about)
    todo = [seed for seed in seeds if seed not in found]
    if found:
        print(f"{len(found)} draws are kept in {kept}; {len(todo)} to go")
    for draw in _shown(_played(asked, todo, options.workers)):
        found[draw["seed"]] = draw
        with kept.open("a", encoding="utf-8") as file:
            file.write(json.dumps(draw) + "\n")
    draws = [found[seed] for seed in seeds]
    content = {"benchmark": "any_tree", **about, **summary(draws), "draws": draws}
    path = sealed.keep(options.block, measure, content)
    if options.json is not None:
        write_text(options.json, json.dumps(content, indent=1) + "\n")
    print("\n".join(lines(draws, f"{measure} ({path})")))
    return 0


def _name(asked: Conditions) -> str:
    """Name of the result: the robot, and what is not as usual."""
    usual = {"tree": "obvious", "grasp": None, "engines": "sapien", "perception": "state", "noise": "fine"}
    said = asked.to_data()
    more = [f"{asked.colours}_colours"] if asked.colours else []
    unusual = [str(said[key]).replace("/", "_").replace(" ", "_") for key in usual if said[key] != usual[key]]
    return "-".join(["any_tree", asked.robot, *(word.partition(":")[0] for word in unusual), *more])


def _resumed(path: Path, about: dict[str, Any]) -> dict[int, dict[str, Any]]:
    """The draws that are there already; the file is begun where there is none.

    Raises:
        InputError: They are of something else.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        path.write_text(json.dumps(about) + "\n", encoding="utf-8")
        return {}
    first, *rest = path.read_text(encoding="utf-8").splitlines()
    if json.loads(first) != json.loads(json.dumps(about)):
        raise InputError(f"'{path}' holds draws of another version or under other conditions: move it away")
    draws = [json.loads(line) for line in rest]
    return {draw["seed"]: draw for draw in draws}


def _played(asked: Conditions, seeds: Sequence[int], workers: int) -> Iterator[dict[str, Any]]:
    """What becomes of each draw, as they end."""
    if workers <= 1:
        player = player_of(asked)
        try:
            yield from (player.play(seed) for seed in seeds)
        finally:
            player.close()
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for done in as_completed([pool.submit(play_one, asked, seed) for seed in seeds]):
            yield done.result()


def _shown(draws: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    began, good = time.perf_counter(), 0
    for number, draw in enumerate(draws, 1):
        good += bool(draw["success"])
        mark = "ok  " if draw["success"] else "LIE " if draw.get("lie") else "FAIL"
        print(f"{mark} {draw['seed']} {draw.get('seconds', 0):5.1f} s  {draw.get('words', '')}")
        if not draw["success"]:
            print(f"       {draw['concept']}: {draw['reason']}: {draw['why']}")
            if "oracle" in draw:
                said = draw["oracle"]
                print(f"       oracle: {'possible' if said['possible'] else 'IMPOSSIBLE'}: {said['why']}")
        print(f"       {good}/{number} in {time.perf_counter() - began:.0f} s", flush=True)
        yield draw


if __name__ == "__main__":
    sys.exit(main())
