"""Thousands of worlds on a device: ``pick_and_place`` through the whole stack, beside bare MuJoCo Warp.

The whole stack is episodes by `BatchRunner`, resets included. Bare is the same model, as many worlds, stepped
as a graph with the arm at rest, and nothing read of it; it runs before and after, in the same process. A rate
is that of control steps; a control step is as many physics steps in both, fine steps not counted.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest import mock

import numpy as np

from bt_tasksim.engines.base import engine_class
from bt_tasksim.execution.batch_runner import BatchRunner
from bt_tasksim.execution.pipelines import LAWS, EngineOptions
from bt_tasksim.trees.load import load_source

WORLDS = {"cpu": 8, "cuda": 4096}
BAR = 0.8
"""Of the bare rate, on a GPU with 4,096 worlds."""
SLICES = 3


def options(parser: argparse.ArgumentParser) -> None:
    """What the section takes."""
    parser.add_argument(
        "--laws", choices=LAWS, default="auto", help="what concepts and joints are computed with (device)"
    )


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """Control steps per second of both, successes, and where the time goes."""
    engine_class("physics", "mujoco_warp").check_device(options.device)
    kind = options.device.partition(":")[0]
    worlds = options.worlds or (WORLDS[kind] // 2 if options.quick and kind == "cpu" else WORLDS[kind])
    source = load_source("pick_and_place")
    engines = EngineOptions(engines="mujoco_warp", device=options.device, laws=options.laws)
    runner = BatchRunner(source.build, source.scene, engines, worlds, threads=_threads(), longest=1.0)
    for _ in runner.run(range(worlds)):  # kernels are compiled, graphs captured
        pass
    batch: Any = runner.worlds.physics
    bare = _bare(batch, worlds, steps=20 if kind == "cpu" else 200)
    before = [bare() for _ in range(SLICES)]
    runner.longest, done, successes = options.longest, runner.control_steps, 0
    with _timed() as spent:
        started = time.perf_counter()
        for _, result in runner.run(range(worlds, 3 * worlds)):
            successes += bool(getattr(result, "success", False))
        wall = time.perf_counter() - started
    done = runner.control_steps - done
    rate, bare_rate = done / wall, statistics.median([*before, *(bare() for _ in range(SLICES))])
    runner.close()
    spent["rest"] = wall - sum(spent.values())
    parts = {part: seconds / wall for part, seconds in spent.items()}
    print(f"\nMuJoCo Warp on {options.device}, {worlds} worlds of pick_and_place, control steps per second")
    print(f"the whole stack {rate:12.0f}     {successes} of {2 * worlds} episodes succeeded, {wall:.0f} s")
    print(f"bare            {bare_rate:12.0f}     of which the stack reaches {rate / bare_rate:.2f}")
    for part, share in sorted(parts.items(), key=lambda item: -item[1]):
        print(f"  {part:24}{share:7.1%}{1e6 * share / rate:10.1f} us a control step and world")
    print(f"bar: {BAR:g} of the bare rate on a GPU with {WORLDS['cuda']} worlds")
    return {
        "device": options.device,
        "worlds": worlds,
        "stack": rate,
        "bare": bare_rate,
        "ratio": rate / bare_rate,
        "successes": successes,
        "episodes": 2 * worlds,
        "parts": parts,
    }


def _threads() -> int:
    return os.cpu_count() or 1


def _bare(batch: Any, count: int, steps: int) -> Callable[[], float]:
    """Control steps per second of bare MuJoCo Warp with the model that most worlds have."""
    import mujoco_warp
    import warp as wp

    group = max(batch.groups.values(), key=lambda group: group.room)
    worlds = group.apart(count)
    worlds.look(np.arange(count))
    with wp.ScopedDevice(batch.device):
        mujoco_warp.step(worlds.model, worlds.data)
        with wp.ScopedCapture(batch.device) as capture:
            mujoco_warp.step(worlds.model, worlds.data)

    def run() -> float:
        wp.synchronize_device(batch.device)
        started = time.perf_counter()
        for _ in range(steps):
            wp.capture_launch(capture.graph)
        wp.synchronize_device(batch.device)
        return count * steps / group.timing.steps / (time.perf_counter() - started)

    return run


@contextmanager
def _timed() -> Iterator[dict[str, float]]:
    """Seconds by part; what a part calls of another counts for the other."""
    from bt_tasksim.engines.kinematics.batch import BatchKinematics
    from bt_tasksim.engines.physics.mujoco_warp import MujocoWarpBatch
    from bt_tasksim.engines.physics.warp_batch.group import WarpGroup
    from bt_tasksim.execution.batch import BatchTree
    from bt_tasksim.execution.worlds import Worlds
    from bt_tasksim.scene.scene import Scene

    calls = (
        ("physics steps", WarpGroup, "period"),
        ("physics, on the host", MujocoWarpBatch, "step"),
        ("worlds that begin", MujocoWarpBatch, "reset"),
        ("draws", Scene, "sample"),
        ("inverse kinematics", BatchKinematics, "solve"),
        ("tree and concepts", BatchTree, "tick"),
        ("observations", Worlds, "observe"),
    )
    spent: defaultdict[str, float] = defaultdict(float)
    inner: list[float] = [0.0]

    def timed(call: Callable[..., Any], part: str) -> Callable[..., Any]:
        def run(*arguments: Any, **named: Any) -> Any:
            inner.append(0.0)
            started = time.perf_counter()
            try:
                return call(*arguments, **named)
            finally:
                took = time.perf_counter() - started
                spent[part] += took - inner.pop()
                inner[-1] += took

        return run

    with ExitStack() as stack:
        for part, owner, name in calls:
            stack.enter_context(mock.patch.object(owner, name, timed(getattr(owner, name), part)))
        yield spent
