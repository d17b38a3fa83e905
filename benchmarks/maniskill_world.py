"""What our side costs in a step of a ManiSkill environment: ``python -m benchmarks.maniskill_world``.

The same episodes are timed inside and outside of ManiSkill's own ``step``; both in one run, so load on the
machine falls on both.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bt_tasksim.core.files import write_text
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import LONGEST, Runner
from bt_tasksim.trees.load import load_source

EXAMPLES = Path(__file__).resolve().parents[1] / "examples" / "maniskill"
TREES = {"PickCube-v1": "pick_cube.py", "StackCube-v1": "stack_cube.py"}


class Stopwatch:
    """Adds up the seconds of a function's calls."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function, self.seconds = function, 0.0

    def __call__(self, *words: Any, **named: Any) -> Any:
        """Call it."""
        started = time.perf_counter()
        try:
            return self._function(*words, **named)
        finally:
            self.seconds += time.perf_counter() - started


def measure(
    environment: str, episodes: int, noise: str = "fine", longest: float = LONGEST
) -> dict[str, float]:
    """Medians over episodes: microseconds a control step, and milliseconds of a reset.

    Args:
        environment: One of `TREES`.
        episodes: How many.
        noise: Name of the noise model.
        longest: Simulated seconds after which an episode is stopped.
    """
    options = EngineOptions(engines=f"maniskill:{environment}", noise=noise)
    source = load_source(str(EXAMPLES / TREES[environment]), world=options.own_world())
    runner = Runner(source.build(), source.scene, options, longest=longest)
    opened: Any = runner.pipeline.physics._open()  # type: ignore[attr-defined]
    step = opened.step = Stopwatch(opened.step)
    reset = opened.reset = Stopwatch(opened.reset)
    kinematics = runner.pipeline.kinematics.solve = Stopwatch(runner.pipeline.kinematics.solve)  # type: ignore[method-assign]
    rows: list[tuple[float, ...]] = []
    for seed in range(episodes + 1):
        for watch in (step, reset, kinematics):
            watch.seconds = 0.0
        started = time.perf_counter()
        result = runner.run(seed)
        whole, n = time.perf_counter() - started - reset.seconds, max(result.control_steps, 1)
        rows.append((step.seconds / n, (whole - step.seconds) / n, kinematics.seconds / n, reset.seconds))
    runner.close()
    theirs, ours, solving, resets = (statistics.median(column) for column in zip(*rows[1:], strict=True))
    return {
        "ManiSkill's step, us": 1e6 * theirs,
        "our side of a step, us": 1e6 * ours,
        "of which inverse kinematics, us": 1e6 * solving,
        "ManiSkill's reset, ms": 1e3 * resets,
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--episodes", type=int, default=30, help="episodes of each environment")
    parser.add_argument("--longest", type=float, default=LONGEST, help="simulated seconds of an episode")
    parser.add_argument("--json", type=Path, help="write the numbers to this file")
    arguments = parser.parse_args()
    found = {name: measure(name, arguments.episodes, longest=arguments.longest) for name in TREES}
    for name, numbers in found.items():
        print(f"{name}: " + ", ".join(f"{what} {value:.0f}" for what, value in numbers.items()))
    if arguments.json is not None:
        write_text(arguments.json, json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
