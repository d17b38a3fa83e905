"""How fast: `make bench`, or ``bt-tasksim bench``. Ratios within one run, medians over rounds in turns.

1. Control steps per second of ``pick_and_place``, whole episodes with their resets, in one world and in
   batches, as ``bt-tasksim evaluate`` runs them, against ManiSkill's ``PickCube-v1`` (one process, state
   observations, ``pd_joint_delta_pos``, random actions), both with 100 Hz physics and 20 Hz control; on two
   cores in two processes each, ManiSkill in the better way of one process and ``SubprocVecEnv``.
2. Time outside physics for one control step of a single world, by part.
3. ``bt-tasksim --help``.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from benchmarks.batch import episodes
from benchmarks.peer_maniskill import Peer
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.core.files import write_text
from bt_tasksim.engines.vulkan import use_software_driver
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import LONGEST, Runner
from bt_tasksim.trees.load import load_source

PURE = ("initial_state", "begin", "violated", "maintained", "carry_out", "explain")
"""The concepts' own functions that a tick calls, besides the policy's."""
CASES = ((1, 1), (64, 1), (256, 1), (64, 2))
"""Worlds of a batch, and processes with a batch each."""
BARS = {"256_1": 4.3, "64_2": 7.0}
"""At least so many times ManiSkill's control steps per second, by case."""
OUTSIDE_US = 1200.0
HELP_S = 0.5
SHORT = 2.0
"""Simulated seconds after which the episodes of a quick look are stopped."""


def main(quick: bool = False, json_path: Path | None = None) -> int:
    """Measure, print the tables, and write the numbers as JSON if asked."""
    found: dict[str, Any] = throughput(quick)
    found |= outside_physics(episodes=1, longest=SHORT) if quick else outside_physics(episodes=20)
    found |= help_time(1 if quick else 7)
    _print(found)
    if json_path is not None:
        write_text(json_path, json.dumps(found, indent=2) + "\n")
        print(f"wrote {json_path}")
    return 0


def throughput(quick: bool) -> dict[str, Any]:
    """Control steps per second of both by case, such as ``256_1``, and the median ratios."""
    peer, out = Peer(), {}
    try:
        for worlds, processes in CASES:
            if processes > (os.cpu_count() or 1) or (quick and (worlds > 1 or processes > 1)):
                continue
            longest = SHORT if quick else LONGEST
            options = argparse.Namespace(threads=1, processes=processes, quick=quick, longest=longest)
            out[f"{worlds}_{processes}"] = episodes.measured(
                worlds, options, peer, apart=False, rounds=1 if quick else 5
            )
    finally:
        peer.close()
    return {"episodes": out, "maniskill_missing": peer.missing}


def outside_physics(episodes: int, robot: str = "panda", longest: float = LONGEST) -> dict[str, Any]:
    """Median microseconds a control step spends in each part; physics is PhysX's own steps."""
    runner = _runner("pick_and_place", robot, longest)
    runner.run(0)
    clock = _Clock()
    physics: Any = runner.pipeline.physics
    clock.wrap(runner, "tick", "tick")
    for leaf in runner.tree.iterate():
        if isinstance(leaf, ConceptNode):
            for name in PURE:
                clock.wrap(leaf.model, name, "concepts")
            clock.wrap(leaf.policy_in_use, "act", "concepts")
    clock.wrap(runner.pipeline.kinematics, "solve", "kinematics")
    clock.wrap(runner.pipeline.postprocess, "observe", "observation")
    clock.wrap(physics, "step", "physics engine")
    clock.wrap(runner.pipeline, "step", "pipeline")
    use_software_driver()
    from sapien import physx

    stepping = clock.timed(physx.PhysxCpuSystem.step, "stepping")
    with mock.patch.object(physx.PhysxCpuSystem, "step", stepping):
        for seed in range(1, 1 + episodes):
            runner.run(seed, record=lambda step: clock.next())
    parts = clock.table()
    parts["state"] = parts["physics engine"] - parts["stepping"]
    tick, concepts = parts["tick"] - parts["concepts"], parts["concepts"]
    rest = parts["pipeline"] - parts["kinematics"] - parts["physics engine"] - parts["observation"]
    table = {
        "tick": np.median(tick),
        "concept functions": np.median(concepts),
        "kinematics": np.median(parts["kinematics"]),
        "observation": np.median(parts["observation"] + parts["state"]),
        "pipeline": np.median(rest),
    }
    outside = tick + concepts + parts["kinematics"] + parts["observation"] + parts["state"] + rest
    return {
        "parts_us": {k: float(1e6 * v) for k, v in table.items()},
        "outside_us": float(1e6 * np.median(outside)),
        "outside_mean_us": float(1e6 * np.mean(outside)),
        "physics_us": float(1e6 * np.median(parts["stepping"])),
    }


class _Clock:
    """Adds up the time of calls within each control step."""

    def __init__(self) -> None:
        self.now: dict[str, float] = {}
        self.rows: list[dict[str, float]] = []
        self.depth = 0

    def wrap(self, owner: Any, name: str, part: str) -> None:
        object.__setattr__(owner, name, self.timed(getattr(owner, name), part))

    def timed(self, call: Callable[..., Any], part: str) -> Callable[..., Any]:
        def inner(*args: Any, **kwargs: Any) -> Any:
            nested = part == "concepts" and self.depth > 0
            self.depth += part == "concepts"
            started = time.perf_counter()
            try:
                return call(*args, **kwargs)
            finally:
                spent = time.perf_counter() - started
                self.depth -= part == "concepts"
                if not nested:
                    self.now[part] = self.now.get(part, 0.0) + spent

        return inner

    def next(self) -> None:
        self.rows.append(self.now)
        self.now = {}

    def table(self) -> dict[str, Any]:
        names = {name for row in self.rows for name in row}
        # Settling after the tree's end has no tick; those steps are not control steps of the tree.
        rows = [row for row in self.rows if "tick" in row and "physics engine" in row]
        return {name: np.array([row.get(name, 0.0) for row in rows]) for name in names}


def help_time(rounds: int) -> dict[str, Any]:
    """Seconds of ``bt-tasksim --help`` in a process of its own, and what it must not import."""
    command = [sys.executable, "-m", "bt_tasksim.cli", "--help"]
    times = []
    for _ in range(rounds):
        started = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        times.append(time.perf_counter() - started)
    check = (
        "import sys, bt_tasksim, bt_tasksim.cli.main; "
        "print(*sorted({'torch', 'sapien', 'mani_skill'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", check], check=True, capture_output=True, text=True)
    heavy = done.stdout.split()
    return {"help_s": statistics.median(times), "help_imports": heavy}


def _runner(scenario: str, robot: str, longest: float) -> Runner:
    source = load_source(scenario, robot)
    return Runner(source.build(), source.scene, EngineOptions(), longest=longest)


def _print(found: dict[str, Any]) -> None:
    def row(label: str, value: float, unit: str, digits: int = 0, bar: str = "") -> None:
        print(f"{label:52}{value:10.{digits}f} {unit:16}{f'(bar: {bar})' if bar else ''}".rstrip())

    if found["maniskill_missing"]:
        print(f"ManiSkill's PickCube-v1 does not start: {found['maniskill_missing']}")
    for case, rates in found["episodes"].items():
        row(f"pick_and_place, {described(case)}", rates["steps_per_s"], "control steps/s")
        if "ratio" in rates:
            row("ManiSkill's PickCube-v1", rates["peer_steps_per_s"], "control steps/s")
            row("ratio", rates["ratio"], "", 2, f"at least {BARS[case]:g}" if case in BARS else "")
    print()
    for part, value in found["parts_us"].items():
        row(f"one world, outside physics: {part}", value, "us")
    row("one world, outside physics, together", found["outside_us"], "us", 0, f"at most {OUTSIDE_US:g}")
    row("one world, physics", found["physics_us"], "us")
    print()
    row("bt-tasksim --help", found["help_s"], "s", 3, f"under {HELP_S:g}")
    print(f"it imports {', '.join(found['help_imports']) or 'none of torch, sapien, mani_skill'}")


def described(case: str) -> str:
    """A case in words."""
    worlds, processes = case.split("_")
    batch = "one world" if worlds == "1" else f"batches of {worlds}"
    return f"{batch}, {'one process' if processes == '1' else f'{processes} processes'}"


if __name__ == "__main__":
    sys.exit(main("--quick" in sys.argv))
