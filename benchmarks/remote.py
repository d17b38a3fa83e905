"""What another process costs: ``python -m benchmarks.remote``. Ratios in one run, medians over rounds.

The same episodes of ``pick_and_place`` with everything in this process, with physics served over
loopback TCP, and with kinematics and physics served by two processes. Then, where pictures can be drawn,
episodes in which a picture with its depth is drawn every ten control periods: everything here; and
physics here, with rendering in another process. The physics of these is MuJoCo's where that engine is
there, else SAPIEN's.

Writes ``benchmarks/results/remote.json``, which ``python -m benchmarks.tables`` takes to
docs/remote_engines.md.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import json
import select
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

from benchmarks.success import RESULTS
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.files import write_text
from bt_tasksim.core.world import JointTarget
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import LONGEST, Runner, Step
from bt_tasksim.trees.load import load_source

EVERY = 10
"""Control periods from one picture to the next, where pictures are drawn."""
QUICK_EVERY = 15
"""The same for a quick look."""
SHORT = 1.0
"""Simulated seconds after which the episodes of a quick look are stopped."""
STEPS = 2000
"""Steps of the robot at rest that are timed."""
CAMERA = "perception"
START = 60.0
"""Seconds that a server may take to start."""


def main() -> int:
    """Measure, print, and write the numbers."""
    parser = argparse.ArgumentParser(description="What another process costs.")
    parser.add_argument("--quick", action="store_true", help="fewer repetitions, and nothing is written")
    options = parser.parse_args()
    found = measure(1, 1, QUICK_EVERY, SHORT, 200) if options.quick else measure(9, 6, EVERY)
    print(json.dumps(found, indent=2))
    if not options.quick:
        write_text(RESULTS / "remote.json", json.dumps(found, indent=2) + "\n")
    return 0


def measure(
    rounds: int, episodes: int, every: int, longest: float = LONGEST, steps: int = STEPS
) -> dict[str, Any]:
    """Control steps per second of every arrangement, in turns, and ratios to that in one process.

    Args:
        rounds: How often each is measured.
        episodes: In each round.
        every: Control periods from one picture to the next, where pictures are drawn.
        longest: Simulated seconds after which an episode is stopped.
        steps: Steps of the robot at rest that are timed.
    """
    here = "mujoco" if importlib.util.find_spec("mujoco") else "sapien"
    found: dict[str, Any] = {"mixed_physics": here}
    with contextlib.ExitStack() as servers:
        physics, other = (servers.enter_context(served("physics", "sapien")) for _ in range(2))
        kinematics = servers.enter_context(served("kinematics", "pinocchio"))
        plain = {
            "in_process": EngineOptions(),
            "physics_served": EngineOptions(engines=physics),
            "two_served": EngineOptions(engines=other, kinematics=kinematics),
        }
        found |= compared(plain, rounds, episodes, longest)
        found["step_us"] = step_times(plain["in_process"], steps)
        found["served_step_us"] = step_times(plain["physics_served"], steps)
    with contextlib.ExitStack() as servers:
        try:
            rendering = servers.enter_context(served("rendering", "sapien"))
        except MachineError as error:
            return found | {"pictures_missing": str(error)}
        drawn = {
            "pictures_in_process": EngineOptions(engines=here, rendering=True),
            "pictures_served": EngineOptions(engines=here, rendering=True, renderer=rendering),
        }
        return found | compared(drawn, max(rounds // 3, 1), 1, longest, every)


@contextlib.contextmanager
def served(role: str, name: str) -> Iterator[str]:
    """An engine in a process of its own, by the name that a client gives it.

    Raises:
        MachineError: It does not start.
    """
    words = [sys.executable, "-m", "bt_tasksim.cli", "serve-engine", role, name, "--port", "0"]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        ready, _, _ = select.select([process.stdout], [], [], START)
        line = process.stdout.readline() if ready else ""
        if not line:
            raise MachineError(f"the {role} engine cannot be served on this machine")
        yield f"remote:127.0.0.1:{line.rpartition(':')[2].split()[0]}"
    finally:
        process.kill()
        process.wait()


def compared(
    ways: dict[str, EngineOptions], rounds: int, episodes: int, longest: float, every: int | None = None
) -> dict[str, Any]:
    """Control steps per second of each way, medians, and medians of the ratios to the first one."""
    rates: dict[str, list[float]] = {name: [] for name in ways}
    runners = {name: runner_of(options, longest) for name, options in ways.items()}
    try:
        for runner in runners.values():
            rate(runner, range(1), every)
        for k in range(rounds):
            seeds = range(1 + k * episodes, 1 + (k + 1) * episodes)
            for name, runner in runners.items():
                rates[name].append(rate(runner, seeds, every))
    finally:
        for runner in runners.values():
            runner.close()
    first, *others = ways
    out = {f"{name}_steps_per_s": statistics.median(values) for name, values in rates.items()}
    for name in others:
        pairs = zip(rates[name], rates[first], strict=True)
        out[f"{name}_ratio"] = statistics.median(a / b for a, b in pairs)
    return out


def runner_of(options: EngineOptions, longest: float = LONGEST) -> Runner:
    """A runner of the scenario that is measured."""
    source = load_source("pick_and_place")
    return Runner(source.build(), source.scene, options, longest=longest)


def rate(runner: Runner, seeds: range, every: int | None) -> float:
    """Control steps per second of whole episodes with their resets, those at the end too."""
    count = [0]

    def record(step: Step) -> None:
        count[0] += 1
        if every is not None and count[0] % every == 0:
            step.pipeline.render(CAMERA, depth=True)

    started = time.perf_counter()
    for seed in seeds:
        runner.run(seed, record=record)
    return count[0] / (time.perf_counter() - started)


def step_times(options: EngineOptions, steps: int) -> float:
    """Median microseconds of a step of the physics engine, with the robot at rest."""
    runner = runner_of(options)
    runner.begin(0)
    assert runner.pipeline.state is not None
    start = runner.pipeline.state
    target = JointTarget(start.joint_position.copy(), 0.0 * start.joint_velocity)
    times = []
    for _ in range(steps):
        started = time.perf_counter()
        runner.pipeline.physics.step(target)
        times.append(time.perf_counter() - started)
    runner.close()
    return 1e6 * statistics.median(times)


if __name__ == "__main__":
    sys.exit(main())
