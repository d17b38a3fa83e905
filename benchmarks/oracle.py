"""What can be grasped at all: a search with full knowledge, in the same physics and under the same judge.

    python -m benchmarks.oracle --robot panda --block B0000
    python -m benchmarks.oracle --robot panda --draws 20    # a look, on development seeds

For each draw of ``grasp_then_pick`` the true shape, size and pose are told, and up to 200 grasps are tried
until the object is held and lifted: the concept's own grasp first, then others that differ in depth, turn,
closure, tilt and offset, likely ones first. A draw that none of them holds is called ungraspable, and
success rates are given with and without such draws.

Writes ``oracle-<robot>.json``, of a block to its folder in ``benchmarks/results``: kind, size and exponents
of each draw, the tries it took, and the grasp that held.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import itertools
import json
import math
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from benchmarks import sealed
from benchmarks.success import RESULTS
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes import Pick
from bt_tasksim.concept_nodes.grasp import Grasp
from bt_tasksim.concept_nodes.grasp_approach import approach_begins, way_out
from bt_tasksim.concept_nodes.grasp_memory import GraspMemory
from bt_tasksim.core import poses
from bt_tasksim.core.errors import BtTasksimError, InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.workers import Workers
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.planning.reference_motion import plan
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.trees import sequence
from bt_tasksim.trees.scenarios import grasp_then_pick

MOST_TRIES = 200
DRAWS = 1000

# Values of each change of the concept's own grasp, and how unlikely each is to help.
DEEPER = {0.0: 0.0, 0.01: 1.0, -0.01: 1.2, 0.02: 1.5, -0.02: 2.0, 0.03: 2.2}
TURN = {0: 0.0, 90: 1.0, 45: 1.1, -45: 1.1, 20: 1.3, -20: 1.3, 70: 1.6, -70: 1.6}
GRIP = {1.0: 0.0, 0.8: 0.9, 0.65: 1.3}
TILT = {0: 0.0, 20: 1.5, -20: 1.5, 50: 2.2, -50: 2.2}
LEAN = {0: 0.0, 15: 1.9, -15: 1.9}
ASIDE = {0.0: 0.0, 0.01: 1.4, -0.01: 1.4}
ACROSS = {0.0: 0.0, 0.008: 1.9, -0.008: 1.9}


@dataclasses.dataclass(frozen=True)
class Change:
    """How a grasp differs from the concept's own.

    Attributes:
        deeper: Metres along the approach.
        turn: Degrees about the approach.
        grip: Closure that is commanded.
        tilt: Degrees by which the approach is turned about the closing axis.
        lean: Degrees by which it is turned towards a finger.
        aside: Metres across approach and closing axis.
        across: Metres along the closing axis.
    """

    deeper: float = 0.0
    turn: float = 0.0
    grip: float = 1.0
    tilt: float = 0.0
    lean: float = 0.0
    aside: float = 0.0
    across: float = 0.0

    def moved(self, goal: Array, centre: Array) -> Array:
        """The grasp poses ``(N, 7)``: turned about the object's centre ``(N, 3)``, then shifted."""
        radians = [math.radians(v) for v in (self.lean, self.tilt, self.turn)]
        lean, tilt, turn = (
            poses.from_rotation_vector(np.eye(3)[i] * angle) for i, angle in enumerate(radians)
        )
        rotation = poses.quat_multiply(turn, poses.quat_multiply(tilt, lean))
        about = np.concatenate([centre, goal[:, 3:]], axis=-1)
        local = poses.relative(about, goal)
        turned = poses.multiply(poses.multiply(about, poses.pose([0, 0, 0], rotation)), local)
        return poses.multiply(turned, poses.pose([self.aside, self.across, self.deeper], [1, 0, 0, 0]))


def changes() -> tuple[Change, ...]:
    """What is tried, likely ones first; the first one changes nothing."""
    tables = (DEEPER, TURN, GRIP, TILT, LEAN, ASIDE, ACROSS)
    rows = itertools.product(*(table.items() for table in tables))
    ranked = sorted(rows, key=lambda row: sum(cost for _, cost in row))
    return tuple(Change(*(value for value, _ in row)) for row in ranked[:MOST_TRIES])


class GivenGrasp(Grasp):
    """A grasp that somebody else has chosen."""

    change = Change()

    def begin(self, seen: Seen) -> GraspMemory:
        """The concept's own plan, to the changed grasp pose."""
        memory = super().begin(seen)
        if self.change == Change(grip=self.change.grip):
            return memory
        goal = self.change.moved(memory.goal, seen.object(self.target)[:, :3])
        back = poses.shifted(goal, -self.standoff * poses.z_axis(goal[:, 3:]))
        path = plan([*way_out(seen, back), back, goal], self.speed, blend=0.03)
        return memory._replace(path=path, begins=approach_begins(path, self.standoff), goal=goal)


def tree_of(change: Change) -> Behaviour:
    """The tree with a grasp that is changed so."""
    leaf = GivenGrasp("target", grip=change.grip, timeout=6.0, policy="programmed")
    leaf.model.change = change
    return sequence("given grasp", leaf, Pick("target", distance=grasp_then_pick.LIFT, speed=0.5))


class Oracle:
    """Searches a grasp for one draw after the other.

    Args:
        robot: Name of the robot.
    """

    def __init__(self, robot: str) -> None:
        self.runner = Runner(tree_of(Change()), grasp_then_pick.scene(robot), EngineOptions(noise="none"))
        self.changes = changes()

    def search(self, seed: int) -> dict[str, Any]:
        """The first grasp that holds, and what was tried."""
        configuration = told(self.runner.scene.sample(seed))
        thing = configuration.objects[0]
        out: dict[str, Any] = {
            "seed": seed,
            "kind": thing.kind,
            "size_mm": [round(1000 * v, 1) for v in thing.size],
            "exponents": [round(v, 3) for v in thing.exponents],
            "mass": round(thing.mass, 3),
            "friction": round(thing.friction, 2),
            "graspable": False,
            "tried": 0,
        }
        reasons: list[str] = []
        for change in self.changes:
            out["tried"] += 1
            why = self._try(configuration, change)
            if not why:
                used = dataclasses.asdict(change)
                out |= {"graspable": True, "held": {k: v for k, v in used.items() if v != _OWN[k]}}
                break
            reasons.append(why)
        if reasons:
            out["own_failed"] = reasons[0]
        return out

    def _try(self, configuration: ActorConfiguration, change: Change) -> str:
        """Why a grasp does not hold; empty when it does."""
        self.runner.plant(functools.partial(tree_of, change))
        try:
            result = self.runner.finish(configuration, self.runner.reset(configuration))
        except InputError:
            raise
        except BtTasksimError as error:
            return type(error).__name__
        return "" if result.success else result.reason


_OWN = dataclasses.asdict(Change())


def told(configuration: ActorConfiguration) -> ActorConfiguration:
    """The same world, with the objects' true sizes known."""
    objects = tuple(dataclasses.replace(o, known_size=None) for o in configuration.objects)
    return dataclasses.replace(configuration, objects=objects)


def survey(robot: str, seeds: range, workers: int) -> Iterator[dict[str, Any]]:
    """The search for each seed, in the order in which they are done."""
    with Workers(functools.partial(Oracle, robot), workers, "spawn") as pool:
        for _, found in pool.spread(_search, seeds):
            yield found


def _search(oracle: Oracle, seeds: Sequence[int], /) -> Iterator[tuple[int, dict[str, Any]]]:
    """The searches in some of the worlds."""
    for index, seed in enumerate(seeds):
        yield index, oracle.search(seed)


def by_kind(draws: list[dict[str, Any]]) -> dict[str, dict[str, int]]:
    """Counts for each kind of shape, and for all."""
    out: dict[str, dict[str, int]] = {}
    for kind in (*sorted({d["kind"] for d in draws}), "all"):
        rows = [d for d in draws if kind in (d["kind"], "all")]
        out[kind] = {
            "draws": len(rows),
            "graspable": sum(d["graspable"] for d in rows),
            "own grasp": sum(d["graspable"] and d["tried"] == 1 for d in rows),
        }
    return out


def text(found: dict[str, Any]) -> str:
    """The table by kind, and the draws that nothing holds."""
    lines = [f"{found['robot']:20}{'draws':>8}{'graspable':>11}{'with the own grasp':>20}"]
    for kind, n in found["kinds"].items():
        lines.append(f"{kind:20}{n['draws']:8d}{n['graspable']:11d}{n['own grasp']:20d}")
    for draw in found["draws"]:
        if not draw["graspable"]:
            size = " x ".join(f"{v:.0f}" for v in draw["size_mm"])
            lines.append(
                f"  nothing holds seed {draw['seed']}: {draw['kind']}, {size} mm, exponents "
                f"{draw['exponents'][0]:.2f} and {draw['exponents'][1]:.2f}, {draw['mass']:.2f} kg, friction "
                f"{draw['friction']:.2f}; the concept's own grasp: {draw['own_failed']}"
            )
    return "\n".join(lines)


def load(robot: str, folder: Path = RESULTS) -> dict[int, dict[str, Any]]:
    """The draws of a robot's results file, by seed.

    Raises:
        InputError: It was not measured yet.
    """
    path = folder / f"oracle-{robot}.json"
    if not path.is_file():
        raise InputError(f"there is no '{path}' yet: run python -m benchmarks.oracle --robot {robot}")
    return {d["seed"]: d for d in json.loads(path.read_text(encoding="utf-8"))["draws"]}


def main(arguments: list[str] | None = None) -> int:
    """Search, print and write."""
    parser = argparse.ArgumentParser(description="Which draws can be grasped at all.")
    parser.add_argument("--robot", default="panda")
    parser.add_argument("--draws", type=int, default=DRAWS)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=sealed.OUT, help="where results go without a block")
    sealed.add_arguments(parser)
    options = parser.parse_args(arguments)
    measure = f"oracle/oracle-{options.robot}"
    try:
        seeds = sealed.choose(options.block, options.seed, measure, options.draws)
    except BtTasksimError as error:
        print(f"oracle: {error}", file=sys.stderr)
        return 2
    started = time.perf_counter()
    draws = []
    for draw in survey(options.robot, seeds, options.workers):
        draws.append(draw)
        if len(draws) % 100 == 0:
            print(f"{len(draws)} draws, {time.perf_counter() - started:.0f} s", file=sys.stderr, flush=True)
    draws.sort(key=lambda d: d["seed"])
    found = {
        "robot": options.robot,
        "scenario": "grasp_then_pick",
        "first_seed": seeds.start,
        "most_tries": MOST_TRIES,
        "kinds": by_kind(draws),
        "tries": sum(d["tried"] for d in draws),
        "draws": draws,
    }
    sealed.keep(options.block, measure, found, options.out)
    print(text(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
