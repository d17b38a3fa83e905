"""All but physics, in NumPy and in torch: what is seen, the tree and its concepts, joints; by worlds.

States of physics are played back: episodes of ``pick_and_place`` are recorded once, and each world goes
through one after the other. Since laws compute what they computed in the recording, that fits. ``--device``
says where torch computes. Processor time, on a GPU time, for a control step and world; draws and beginnings
are left out.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any
from unittest import mock

import numpy as np

from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Hidden, JointTarget, WorldState
from bt_tasksim.engines.batch import PhysicsBatch
from bt_tasksim.execution.batch_runner import BatchRunner
from bt_tasksim.execution.laws import laws_of
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.trees.load import load_source

WORLDS = (64, 1024, 4096)
PARTS = ("observe", "tree", "joints", "rest")
EPISODES = 48
PERIODS = 60


def options(parser: argparse.ArgumentParser) -> None:
    """What the section takes: nothing of its own."""


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """Microseconds of a control step and world, by part, library and worlds."""
    out: dict[str, Any] = {"device": options.device}
    print("\nall but physics, us of a control step and world")
    print(f"{'worlds':>8}  {'laws':8}" + "".join(f"{part:>9}" for part in (*PARTS, "all")))
    recorded = Recorded(2 if options.quick and options.worlds else EPISODES, options.longest)
    counts = WORLDS[:2] if options.quick else WORLDS
    for worlds in (options.worlds,) if options.worlds else counts:
        for laws in ("numpy", "torch"):
            try:
                like = laws_of(_no_check(laws, options.device))
            except MachineError as error:
                out["torch_missing"] = str(error)
                print(f"{worlds:8}  {laws:8}  {error}")
                continue
            found = out[f"{worlds}, {laws}"] = _measured(
                worlds, like, recorded, 20 if options.quick else PERIODS
            )
            print(
                f"{worlds:8}  {laws:8}" + "".join(f"{found[part]:9.1f}" for part in (*PARTS, "all")),
                flush=True,
            )
    return out


class Recorded:
    """Episodes of ``pick_and_place`` with all that physics said in them.

    Args:
        episodes: How many.
        longest: Simulated seconds after which they are stopped.

    Attributes:
        episodes: How many there are.
        source: The tree and its scene.
        drawn: Worlds by seed.
        states: By name of a field of `WorldState`, ``(seeds, most periods, ...)``.
        hidden: The same of `Hidden`.
        ends: Periods of each ``(seeds,)``.
    """

    def __init__(self, episodes: int, longest: float) -> None:
        self.source, everyone = load_source("pick_and_place"), np.arange(episodes)
        self.episodes, engines = episodes, EngineOptions(laws="numpy")
        runner = BatchRunner(self.source.build, self.source.scene, engines, episodes, longest=longest)
        physics = runner.worlds.physics
        said: list[tuple[Array, WorldState, Hidden]] = []

        def heard(call: Callable[..., None], rows_at: int) -> Callable[..., None]:
            def run(*arguments: Any) -> None:
                call(*arguments)
                rows = arguments[rows_at]
                said.append((rows, physics.state(rows), physics.hidden(rows)))

            return run

        with (
            mock.patch.object(physics, "reset", heard(physics.reset, 0)),
            mock.patch.object(physics, "step", heard(physics.step, 1)),
        ):
            for _ in runner.run(everyone.tolist()):
                pass
        runner.close()
        self.drawn = {seed: self.source.scene.sample(seed) for seed in everyone.tolist()}
        self.ends = np.bincount(np.concatenate([rows for rows, _, _ in said]), minlength=episodes)
        self.states = self._table([(rows, state) for rows, state, _ in said])
        self.hidden = self._table([(rows, hidden) for rows, _, hidden in said])

    def _table(self, bundles: Sequence[tuple[Array, Any]]) -> dict[str, Array]:
        out: dict[str, Array] = {}
        at = np.zeros(self.episodes, int)
        for rows, bundle in bundles:
            for field in dataclasses.fields(bundle):
                values = getattr(bundle, field.name)
                if field.name not in out:
                    out[field.name] = np.zeros(
                        (self.episodes, self.ends.max(), *values.shape[1:]), values.dtype
                    )
                out[field.name][rows, at[rows]] = values
            at[rows] += 1
        return out

    def sample(self, seed: int, stream: str = "evaluation", stage: int | None = None) -> ActorConfiguration:
        """A recorded world; seeds beyond them are those again."""
        return self.drawn[seed % self.episodes]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.source.scene, name)


class Played(PhysicsBatch):
    """Physics that plays back what was recorded, whatever it is told.

    Args:
        recorded: The recording.
        worlds: How many there are.
    """

    def __init__(self, recorded: Recorded, worlds: int) -> None:
        super().__init__(worlds)
        self._recorded, self._of, self._at = recorded, np.zeros(worlds, int), np.zeros(worlds, int)

    def reset(self, rows: Array, configurations: Sequence[ActorConfiguration]) -> None:
        """See `PhysicsBatch.reset`."""
        self._of[rows], self._at[rows] = [c.seed for c in configurations], 0

    def step(self, target: JointTarget, rows: Array) -> None:
        """See `PhysicsBatch.step`."""
        self._at[rows] = np.minimum(self._at[rows] + 1, self._recorded.ends[self._of[rows]] - 1)

    def state(self, rows: Array) -> WorldState:
        """See `PhysicsBatch.state`."""
        at = self._of[rows], self._at[rows]
        return WorldState(**{name: values[at] for name, values in self._recorded.states.items()})

    def hidden(self, rows: Array) -> Hidden:
        """See `PhysicsBatch.hidden`."""
        at = self._of[rows], self._at[rows]
        return Hidden(**{name: values[at] for name, values in self._recorded.hidden.items()})


def _no_check(laws: str, device: str) -> EngineOptions:
    """Options with a device that SAPIEN, which is not asked for anything, does not know."""
    return EngineOptions("mujoco_warp" if device != "cpu" else "sapien", device=device, laws=laws)


def _measured(worlds: int, like: Array, recorded: Recorded, periods: int) -> dict[str, float]:
    """Measured is from when the longest first episode has ended: worlds are at unlike moments then."""
    with mock.patch("bt_tasksim.execution.worlds.check_memory"):
        runner = BatchRunner(recorded.source.build, recorded, EngineOptions(), worlds, like=like)
    runner.worlds.physics.close()
    runner.worlds.physics = Played(recorded, worlds)
    first, period, count, began, done = int(recorded.ends.max()), runner._period, 0, 0.0, 0
    clock = (
        time.process_time if isinstance(like, np.ndarray) or like.device.type == "cpu" else time.perf_counter
    )

    def counted(*arguments: Any) -> Iterator[Any]:
        nonlocal count, began, done
        if count == first:
            spent.clear()
            began, done = clock(), runner.control_steps
        count += 1
        if count > first + periods:
            raise _EnoughError
        return period(*arguments)

    with _timed(runner, clock) as spent, mock.patch.object(runner, "_period", counted):
        with suppress(_EnoughError):
            for _ in runner.run(iter(range(10**9))):
                pass
        wall, done = clock() - began, runner.control_steps - done
    runner.close()
    found = {part: 1e6 * spent[part] / done for part in PARTS[:-1]}
    all_of_it = 1e6 * (wall - spent["beginning"]) / done
    return {**found, "rest": all_of_it - sum(found.values()), "all": all_of_it}


class _EnoughError(Exception):
    """Enough was measured."""


@contextmanager
def _timed(runner: BatchRunner, clock: Callable[[], float]) -> Iterator[defaultdict[str, float]]:
    """Seconds by part."""
    spent: defaultdict[str, float] = defaultdict(float)

    def timed(call: Any, part: str) -> Any:
        def run(*arguments: Any, **named: Any) -> Any:
            started = clock()
            try:
                return call(*arguments, **named)
            finally:
                spent[part] += clock() - started

        return run

    calls = (
        ("observe", runner.worlds, "observe"),
        ("tree", runner.batch, "tick"),
        ("joints", runner.worlds.kinematics, "solve"),
        ("beginning", runner.worlds, "reset"),
        ("beginning", runner, "_episodes_of"),
    )
    patches = [mock.patch.object(o, name, timed(getattr(o, name), part)) for part, o, name in calls]
    for patch in patches:
        patch.start()
    try:
        yield spent
    finally:
        for patch in patches:
            patch.stop()
