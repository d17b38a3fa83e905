"""How well demonstration logs are decomposed: ``python -m benchmarks.decomposition``.

Prints one line per log of the fifty that count: the ten shipped ones of each scenario, and ten recorded ones
each of ManiSkill's PickCube and StackCube where they are present (``../shared/demonstrations``), with the
reason for each miss. Then the share of right sequences over fresh synthetic seeds, with ``--block B0000``
those of a sealed block, also with more noise than the shipped logs have.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks import sealed
from bt_tasksim.core.errors import BtTasksimError
from bt_tasksim.core.resources import asset
from bt_tasksim.demos_decomp.log import Demonstration
from bt_tasksim.demos_decomp.readers import open_log
from bt_tasksim.demos_decomp.recognition import recognise
from bt_tasksim.demos_decomp.synthetic import SHIPPED, make
from bt_tasksim.demos_decomp.synthetic_motion import Sensing

WHOLE = ("grasp", "pick", "bring", "place", "release")
EXPECTED = {
    "pick_and_place": WHOLE,
    "shelf_to_shelf": WHOLE,
    "pick_and_throw": ("grasp", "pick", "bring", "release"),
    "PickCube-v1": ("grasp", "pick", "bring"),
    "StackCube-v1": WHOLE,
}
RECORDED = Path(__file__).resolve().parents[2] / "shared" / "demonstrations" / "maniskill"


def logs() -> Iterator[tuple[str, str, Demonstration]]:
    """Scenario, label and demonstration of each log that counts and is present."""
    for scenario in EXPECTED:
        if not scenario.endswith("-v1"):
            for number in range(SHIPPED):
                path = asset("demonstrations", scenario, f"{number:02d}.h5")
                yield scenario, path.name, open_log(path).demonstrations[0]
        elif (path := RECORDED / scenario / "trajectory.h5").exists():
            for shown in open_log(path).demonstrations:
                yield scenario, f"traj_{int(shown.name)}", shown
        else:
            print(f"{scenario}: not present on this machine, left out")


def interval(right: int, of: int) -> str:
    """Wilson's 95 % interval of a share."""
    z, p = 1.96, right / of
    middle = (p + z * z / (2 * of)) / (1 + z * z / of)
    half = z / (1 + z * z / of) * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    return f"{right} of {of} ({100 * max(middle - half, 0):.1f} to {100 * min(middle + half, 1):.1f} %)"


def fifty() -> None:
    """The table of the logs that count."""
    print(f"{'scenario':<16}{'log':<9}{'recognised':<42}{'confidence':>10}")
    right = seen = 0
    spent = shown_for = 0.0
    misses = []
    for scenario, label, shown in logs():
        begin = time.perf_counter()
        tasks, remarks = recognise(shown)
        spent += time.perf_counter() - begin
        shown_for += float(shown.time[-1] - shown.time[0])
        found = tuple(task.concept for task in tasks)
        sure = math.prod(task.confidence for task in tasks)
        seen += 1
        right += found == EXPECTED[scenario]
        mark = "" if found == EXPECTED[scenario] else "  MISS"
        print(f"{scenario:<16}{label:<9}{' '.join(found):<42}{sure:>10.2f}{mark}")
        if mark:
            misses.append(f"{scenario} {label}: {'; '.join(map(str, remarks)) or 'no remark'}")
    print(f"\nright sequence: {right} of {seen}")
    print("\n".join(f"miss: {miss}" for miss in misses))
    print(f"{shown_for / spent:.0f} s of demonstration decomposed a second\n")


def fresh(seeds: range) -> dict[str, dict[str, int]]:
    """Right sequences over synthetic seeds, by scenario and how many times the noise is the shipped logs'."""
    found: dict[str, dict[str, int]] = {}
    print(f"{'fresh seeds':<18}" + "".join(f"{f'noise x {factor}':<28}" for factor in (1, 2, 3, 4)))
    for scenario in (name for name in EXPECTED if not name.endswith("-v1")):
        row = []
        for factor in (1, 2, 3, 4):
            sensing = Sensing().worse(factor)
            right = 0
            for seed in seeds:
                tasks, _ = recognise(make(scenario, seed, sensing)[0])
                right += tuple(task.concept for task in tasks) == EXPECTED[scenario]
            row.append(interval(right, len(seeds)))
            found.setdefault(scenario, {})[f"noise x {factor}"] = right
        print(f"{scenario:<18}" + "".join(f"{cell:<28}" for cell in row))
    return found


def main() -> int:
    """Prints both tables."""
    parser = argparse.ArgumentParser(description="How well demonstration logs are decomposed.")
    parser.add_argument("--seeds", type=int, default=200, help="fresh synthetic seeds per scenario and noise")
    sealed.add_arguments(parser)
    options = parser.parse_args()
    measure = "decomposition/decomposition-fresh"
    try:
        seeds = sealed.choose(options.block, options.seed, measure, options.seeds)
        fifty()
        if seeds:
            content = {"first_seed": seeds.start, "seeds": len(seeds), "right": fresh(seeds)}
            sealed.keep(options.block, measure, content)
    except BtTasksimError as error:
        print(f"decomposition: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
