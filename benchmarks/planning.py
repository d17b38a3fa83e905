"""How long a way takes to be planned: ``python -m benchmarks.planning``.

Random requests of three robots in three kinds of worlds: a table, the same with eight objects on it, and one
with a shelf and some objects. Each request is one as a concept makes it: the bodies of the world are built, a
straight way of the tool is tried, and where that is not clear a way is searched for and timed.
"""

from __future__ import annotations

import argparse
import cProfile
import json
import pstats
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.files import write_text
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.arm import arm_of
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.collision import Collisions
from bt_tasksim.planning.route import Pace
from bt_tasksim.planning.surroundings import CLEAR_OF_FURNITURE, CLEAR_OF_OBJECTS
from bt_tasksim.planning.things import Held, Thing, box_corners
from bt_tasksim.planning.ways import WayFinder
from bt_tasksim.robot.description import RobotDescription, load_robot

ROBOTS = ("panda", "xarm7_ability", "so100")
WORLDS = ("table", "clutter", "shelf")
MEDIAN_MS, SELDOM_MS = 60.0, 500.0
"""At most so long takes a way in the middle of all requests, and one in a hundred of them longer than
that."""
RESULT = Path(__file__).parent / "results" / "planning.json"


class Request(NamedTuple):
    """A way that is asked for.

    Attributes:
        things: What stands around.
        start: The arm's joints ``(n_arm,)``.
        held: What is in the hand.
        goal: Tool pose ``(7,)``.
    """

    things: list[Thing]
    start: Array
    held: Held
    goal: Array


class Taken(NamedTuple):
    """What it took, milliseconds.

    Attributes:
        construction: Bodies of the world.
        straight: The straight way.
        search: The search, and the timing of what it found; None where the straight way is clear.
        found: There is a way.
    """

    construction: float
    straight: float
    search: float | None
    found: bool

    @property
    def whole(self) -> float:
        """All of it."""
        return self.construction + self.straight + (self.search or 0.0)


def things_in(kind: str, reach: float, rng: np.random.Generator) -> list[Thing]:
    """A world of a kind before an arm of some reach in metres, which looks along x."""
    low, high = 0.45 * reach, 0.85 * reach
    table = Thing("table", poses.pose([0.6 * reach, 0.0, -0.06]), (2 * reach, 2.4 * reach, 0.1), (), 0.008)
    things = [table]
    if kind == "shelf":
        at, depth, wide = 1.0 * reach, 0.3 * reach, 0.8 * reach
        sizes = {
            **{f"board {k}": ((depth, wide, 0.015), (at, 0.0, (0.25 + 0.4 * k) * reach)) for k in range(2)},
            **{
                f"side {k}": ((depth, 0.015, 0.9 * reach), (at, (k - 0.5) * wide, 0.45 * reach))
                for k in range(2)
            },
        }
        things += [
            Thing(name, poses.pose(place), size, (), CLEAR_OF_FURNITURE)
            for name, (size, place) in sizes.items()
        ]
    for k in range({"table": 0, "clutter": 8, "shelf": 3}[kind]):
        size = rng.uniform([0.03, 0.03, 0.05], [0.07, 0.07, 0.2]) * min(reach / 0.8, 1.0)
        angle, far = rng.uniform(-1.0, 1.0), rng.uniform(low, high)
        place = [far * np.cos(angle), far * np.sin(angle), size[2] / 2]
        turned = poses.pose(place, poses.yaw(rng.uniform(-3.0, 3.0)))
        things.append(Thing(f"object {k}", turned, None, (box_corners(size.tolist()),), CLEAR_OF_OBJECTS))
    return things


def requests(robot: RobotDescription, kind: str, count: int, seed: int = 0) -> list[Request]:
    """Requests whose beginnings and ends are clear."""
    rng = np.random.default_rng(seed)
    arm, out = arm_of(robot), []
    home = arm.tool(robot.rest)
    reach = 1.35 * float(np.linalg.norm(home[:2]))
    size = np.array([0.04, 0.04, 0.06]) * min(reach / 0.8, 1.0)
    held = Held("held", poses.pose([0.0, 0.0, 0.0]), (box_corners(size.tolist()),))
    before = poses.pose([0.0, 0.0, 0.0], poses.yaw(float(np.arctan2(home[1], home[0]))))
    while len(out) < count:
        things = [replace(t, pose=poses.multiply(before, t.pose)) for t in things_in(kind, reach, rng)]
        collisions = Collisions(bodies_of(robot), robot.hand_open, things, held)
        ends: list[Array] = []
        for _ in range(60):
            angle, far = rng.uniform(-1.1, 1.1), rng.uniform(0.45, 0.85) * reach
            place = [far * np.cos(angle), far * np.sin(angle), rng.uniform(0.06, 0.6) * reach]
            turn = poses.quat_multiply(poses.yaw(angle), home[3:])
            q = arm.joints(poses.pose(poses.transform(before, np.array(place)), turn), robot.rest)
            if q is not None and collisions.free(q):
                ends.append(q)
            if len(ends) == 2:
                out.append(Request(things, ends[0], held, arm.tool(ends[1])))
                break
    return out


def answered(robot: RobotDescription, request: Request) -> Taken:
    """Answer a request."""
    began = time.perf_counter()
    finder = WayFinder(robot, request.start, robot.hand_open, request.things, request.held)
    built = time.perf_counter()
    joints = finder.straight([finder.arm.tool(request.start), request.goal])
    tried = time.perf_counter()
    construction, straight = 1e3 * (built - began), 1e3 * (tried - built)
    if joints is not None:
        return Taken(construction, straight, None, True)
    try:
        finder.search(request.goal[None], Pace(0.5))
        found = True
    except NoWayError:
        found = False
    return Taken(construction, straight, 1e3 * (time.perf_counter() - tried), found)


def summary(taken: list[Taken]) -> dict[str, Any]:
    """Medians and 99th percentiles in milliseconds, and how often which way was taken."""

    def spread(values: list[float]) -> list[float] | None:
        return [round(float(np.percentile(values, p)), 2) for p in (50, 99)] if values else None

    searched = [t.search for t in taken if t.search is not None]
    return {
        "requests": len(taken),
        "searched": len(searched),
        "no_way": sum(not t.found for t in taken),
        "construction_ms": spread([t.construction for t in taken]),
        "straight_and_clear_ms": spread([t.straight for t in taken if t.search is None]),
        "search_ms": spread(searched),
        "whole_ms": spread([t.whole for t in taken]),
    }


def measured(count: int) -> dict[str, Any]:
    """All cases."""
    results: dict[str, Any] = {}
    for name in ROBOTS:
        robot = load_robot(name)
        for kind in WORLDS:
            asked = requests(robot, kind, count)
            answered(robot, asked[0])  # what is made once for a robot
            results[f"{name} {kind}"] = summary([answered(robot, request) for request in asked])
    return results


def show(results: dict[str, Any]) -> None:
    """Print the table."""
    table = Table("robot and world", "searched", "no way", "construction", "straight", "search", "whole")
    for name, row in results.items():
        cells = [
            "-" if row[f"{part}_ms"] is None else " / ".join(f"{v:.1f}" for v in row[f"{part}_ms"])
            for part in ("construction", "straight_and_clear", "search", "whole")
        ]
        table.add_row(name, f"{row['searched']} of {row['requests']}", str(row["no_way"]), *cells)
    Console(width=130).print(table)
    Console().print("Milliseconds: median / 99 %.")


def profiled() -> None:
    """What takes the time of searches."""
    robot = load_robot("panda")
    asked = requests(robot, "shelf", 30)
    profile = cProfile.Profile()
    profile.enable()
    for request in asked:
        answered(robot, request)
    profile.disable()
    pstats.Stats(profile).sort_stats("tottime").print_stats(18)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few requests, and no file is written")
    parser.add_argument("--profile", action="store_true", help="print what takes the time, and nothing else")
    given = parser.parse_args()
    if given.profile:
        profiled()
        return
    results = measured(15 if given.quick else 200)
    show(results)
    if not given.quick:
        write_text(RESULT, json.dumps({"milliseconds": "median, 99 %", "cases": results}, indent=1) + "\n")
    slow = [
        name
        for name, row in results.items()
        if row["search_ms"] and (row["search_ms"][0] > MEDIAN_MS or row["search_ms"][1] > SELDOM_MS)
    ]
    Console().print(f"slower than asked: {', '.join(slow)}" if slow else "as fast as asked")


if __name__ == "__main__":
    main()
