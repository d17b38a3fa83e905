"""Physics of many worlds: microseconds of a control step and world, for each simulator.

The drives are told what a run of ``pick_and_place`` told them, each world at another place of its episode;
worlds begin anew at its end. By one thread the time of the processor is divided: the simulator's own steps,
setting targets, and reading the state, which is all the rest. By two threads, and by two processes of one
thread with half of the worlds each, it is the wall clock that counts, in turns.
"""

from __future__ import annotations

import argparse
import multiprocessing
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Any
from unittest import mock

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import JointTarget
from bt_tasksim.engines.base import EngineSetup, engine_class
from bt_tasksim.engines.batch import PhysicsBatch
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.robot.description import RobotDescription, load_robot
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.trees.load import load_source

ENGINES = ("sapien", "mujoco")
WORLDS = (1, 64, 256)
SEEDS = (20000, 20001, 20002, 20003)
BAR_US = 30.0
"""For setting targets and reading, SAPIEN, 256 worlds."""


def options(parser: argparse.ArgumentParser) -> None:
    """What the section takes."""
    parser.add_argument("--engine", choices=ENGINES, help="only this one, in the section physics")


@dataclass
class Told:
    """What was drawn, and what the drives were told in each period."""

    configuration: ActorConfiguration | None = None
    targets: list[JointTarget] = field(default_factory=list)


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """Microseconds by engine and number of worlds."""
    counts, budget = (WORLDS[:2], 2000) if options.quick else (WORLDS, 20000)
    counts = (options.worlds,) if options.worlds else counts
    out: dict[str, Any] = {}
    for engine in (options.engine,) if options.engine else ENGINES:
        told = [_record(engine, seed) for seed in SEEDS]
        print(f"\n{engine}, us of a control step and world")
        print(f"{'worlds':>8}{'steps':>9}{'targets':>9}{'reading':>9}{'reset':>9}   wall: ", end="")
        print(f"{'1 thread':>9}{'2 threads':>10}{'2 processes':>12}")
        out[engine] = {}
        for worlds in counts:
            found = out[engine][worlds] = _measure(engine, told, worlds, max(budget // worlds, 20))
            print(
                f"{worlds:8}{found['steps']:9.1f}{found['targets']:9.1f}{found['reading']:9.1f}"
                f"{found['reset']:9.1f}   wall: {found['1 thread']:9.1f}{found['2 threads']:10.1f}"
                + (f"{found['2 processes']:12.1f}" if "2 processes" in found else ""),
                flush=True,
            )
    print("\nreset: of a fresh world, over the control steps of its episode")
    print(f"bar: targets and reading at most {BAR_US:g} us together with SAPIEN, 256 worlds")
    return out


class Replay:
    """A batch whose worlds each repeat a recorded run, from another place of it on.

    Args:
        engine: Name of the physics.
        told: The recorded runs.
        worlds: How many worlds.
        threads: How many threads.
    """

    def __init__(self, engine: str, told: list[Told], worlds: int, threads: int) -> None:
        robot: RobotDescription = load_robot("panda")
        self.batch: PhysicsBatch = engine_class("physics", engine).batch(  # type: ignore[attr-defined]
            robot, EngineSetup(engine), worlds, threads
        )
        self._told, self._rows = told, np.arange(worlds)
        self._of = self._rows % len(told)
        self._at = np.zeros(worlds, int)
        self.resets = 0.0
        self._begin(self._rows)
        length = min(len(run.targets) for run in told)
        first = (self._rows * 37) % length  # spread over the episode
        for k in range(int(first.max())):
            self._step(self._rows[first > k])

    def _begin(self, rows: Array) -> None:
        self._at[rows] = 0
        self.batch.reset(rows, [self._told[k].configuration for k in self._of[rows]])  # type: ignore[misc]

    def _step(self, rows: Array) -> None:
        now = [self._told[k].targets[at] for k, at in zip(self._of[rows], self._at[rows], strict=True)]
        target = JointTarget(np.array([t.position for t in now]), np.array([t.velocity for t in now]))
        self.batch.step(target, rows)
        self._at[rows] += 1

    def step(self, clock: Callable[[], float]) -> tuple[float, float]:
        """One control step of all worlds; seconds that it took, and the resets before it."""
        lengths = np.array([len(self._told[k].targets) for k in self._of])
        over = self._rows[self._at == lengths]
        begun = clock()
        if len(over):
            self._of[over] = (self._of[over] + 1) % len(self._told)
            self._begin(over)
        rows = self._rows
        now = [self._told[k].targets[at] for k, at in zip(self._of, self._at, strict=True)]
        target = JointTarget(np.array([t.position for t in now]), np.array([t.velocity for t in now]))
        started = clock()
        self.batch.step(target, rows)
        self.batch.state(rows)
        self.batch.hidden(rows)
        ended = clock()
        self._at += 1
        return ended - started, started - begun


def _measure(engine: str, told: list[Told], worlds: int, steps: int) -> dict[str, float]:
    with _timed(engine) as spent:
        replay, each, resets = Replay(engine, told, worlds, 1), [], []
        for _ in range(steps):
            spent.update(steps=0.0, targets=0.0)
            total, reset = replay.step(time.thread_time)
            each.append((spent["steps"], spent["targets"], total - spent["steps"] - spent["targets"]))
            resets.append(reset)
        replay.batch.close()
    scale = 1e6 / worlds
    parts = (scale * statistics.median(part) for part in zip(*each, strict=True))
    found = dict(zip(("steps", "targets", "reading"), parts, strict=True))
    found["reset"] = scale * statistics.mean(resets)
    replays = {f"{n} thread{'s' * (n > 1)}": Replay(engine, told, worlds, n) for n in (1, 2)}
    walls: dict[str, list[float]] = {name: [] for name in replays}
    for _ in range(steps):
        for name, replay in replays.items():
            walls[name].append(replay.step(time.perf_counter)[0])
    for name, replay in replays.items():
        found[name] = scale * statistics.median(walls[name])
        replay.batch.close()
    if worlds > 1:
        found["2 processes"] = scale * _two_processes(engine, told, worlds // 2, steps)
    return found


def _two_processes(engine: str, told: list[Told], worlds: int, steps: int) -> float:
    """Seconds of a control step in two processes at once: the slower one's median."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(2) as pool:
        barrier = context.Manager().Barrier(2)
        jobs = [pool.apply_async(_other, (engine, told, worlds, steps, barrier)) for _ in range(2)]
        return max(job.get() for job in jobs)


def _other(engine: str, told: list[Told], worlds: int, steps: int, barrier: Any) -> float:
    replay = Replay(engine, told, worlds, 1)
    barrier.wait()
    return statistics.median(replay.step(time.perf_counter)[0] for _ in range(steps))


@contextmanager
def _timed(engine: str) -> Iterator[dict[str, float]]:
    """Seconds of this thread in the simulator's own steps, and in setting targets."""
    spent = {"steps": 0.0, "targets": 0.0}

    def timed(call: Callable[..., Any], part: str) -> Callable[..., Any]:
        def inner(*arguments: Any) -> Any:
            started = time.thread_time()
            try:
                return call(*arguments)
            finally:
                spent[part] += time.thread_time() - started

        return inner

    with ExitStack() as stack:
        for part, (owner, name) in _timed_calls(engine).items():
            stack.enter_context(mock.patch.object(owner, name, timed(getattr(owner, name), part)))
        yield spent


def _timed_calls(engine: str) -> dict[str, tuple[Any, str]]:
    if engine == "sapien":
        from sapien import physx

        from bt_tasksim.engines.physics.sapien_robot import Robot

        return {"steps": (physx.PhysxCpuSystem, "step"), "targets": (Robot, "drive_to")}
    import mujoco

    from bt_tasksim.engines.physics.mujoco_stepping import MujocoWorld

    return {"steps": (mujoco, "mj_step"), "targets": (MujocoWorld, "drive_to")}


def _record(engine: str, seed: int) -> Told:
    source, told = load_source("pick_and_place"), Told()
    runner = Runner(source.build(), source.scene, EngineOptions(engines=engine))
    physics: Any = runner.pipeline.physics
    reset, step = physics.reset, physics.step

    def told_reset(configuration: ActorConfiguration) -> Any:
        told.configuration = configuration
        return reset(configuration)

    def told_step(target: JointTarget) -> Any:
        told.targets.append(target)
        return step(target)

    physics.reset, physics.step = told_reset, told_step
    runner.run(seed)
    return told
