"""The states of a seed's world, bit by bit: in batches of any size, order and number of threads, under Ray.

Hashed are all states and hidden states of an episode, control period after control period, from a run of one
world by py_trees (`Runner`), and from batches (`BatchRunner`). Under Ray outcomes are compared, their errors
of position and angle and their overlap to the last bit; there an actor is killed in the middle, too.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import os
import signal
import warnings
from collections.abc import Iterator, Sequence
from typing import Any
from unittest import mock

import numpy as np
import psutil

from bt_tasksim.core.errors import BtTasksimError, BtTasksimWarning
from bt_tasksim.core.world import Hidden, WorldState
from bt_tasksim.engines.physics.threaded import ThreadedBatch
from bt_tasksim.execution.batch_runner import BatchRunner
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.training.evaluation import Job, evaluate
from bt_tasksim.trees.load import load_source

TREE = "pick_and_place_recovering"
ENGINES = ("sapien", "mujoco")
BATCHES = ((1, 1), (2, 1), (2, 2), (64, 1), (64, 2))
"""Worlds and threads."""
EPISODES = 70
ACTORS = (1, 3)


def options(parser: argparse.ArgumentParser) -> None:
    """What the section takes."""
    parser.add_argument("--episodes", type=int, default=EPISODES, help="episodes of a row (same-bits)")


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """How many episodes were the same in each row; ``differs`` names the first that was not."""
    episodes = min(options.episodes, 6) if options.quick else options.episodes
    seeds, out = range(episodes), {}
    for engine in ENGINES:
        alone = _alone(engine, seeds, options.longest)
        for worlds, threads in BATCHES if not options.quick else BATCHES[2:3]:
            for order in ("seeds in order", "shuffled"):
                shuffled = np.random.default_rng(worlds).permutation(episodes).tolist()
                ordered = seeds if order == "seeds in order" else shuffled
                found = _in_batch(engine, ordered, worlds, threads, options.longest)
                row = f"{engine}, {worlds} worlds, {threads} threads, {order}"
                out[row] = _compared(row, alone, found, out)
        if not options.quick:
            job = Job(TREE, options=EngineOptions(engines=engine), batch=4, longest=options.longest)
            here = _outcomes(evaluate(dataclasses.replace(job, batch=1), seeds).outcomes)
            for actors in ACTORS:
                for kill in (False, True):
                    row = f"{engine}, Ray, {actors} actors{', one killed' if kill else ''}"
                    out[row] = _compared(row, here, _on_ray(job, seeds, actors, kill), out)
    return out


def _compared(row: str, wanted: dict[int, str], found: dict[int, str], out: dict[str, Any]) -> int:
    same = sum(found.get(seed) == wanted[seed] for seed in wanted)
    print(f"{row:60}{same:5} of {len(wanted)} the same", flush=True)
    if same < len(wanted) or found.keys() != wanted.keys():
        out.setdefault("differs", row)
    return same


class _Hashes:
    """Hashes of states, by the row of a world, from one reset to the next."""

    def __init__(self) -> None:
        self.of: dict[int, Any] = {}

    def watch(self, batch: ThreadedBatch[Any]) -> mock._patch[Any]:
        """Look at each state that a batch of physics reads."""
        gather = batch._gather

        def gathered(rows: np.ndarray) -> None:
            gather(rows)
            state, hidden = batch.state(rows), batch.hidden(rows)
            for k, row in enumerate(rows.tolist()):
                self.of.setdefault(row, hashlib.sha256()).update(_bytes(batch, state, hidden, row, k))

        return mock.patch.object(batch, "_gather", gathered)

    def take(self, row: int) -> str:
        """The hash of the episode that has ended in a row, which begins anew."""
        found = self.of.pop(row, None)
        return "" if found is None else str(found.hexdigest())


def _bytes(batch: ThreadedBatch[Any], state: WorldState, hidden: Hidden, row: int, k: int) -> bytes:
    """A state as bytes, without what other worlds have more objects of."""
    n = batch.simulated[row].n_objects if batch.simulated[row] is not None else 0  # type: ignore[union-attr]
    own = ("objects", "velocities", "hand_force", "hand_distance")
    out = b""
    for bundle in (state, hidden):
        for field in dataclasses.fields(bundle):
            values = np.asarray(getattr(bundle, field.name)[k])
            if field.name == "support":
                values = values[:n, :n]
            out += np.ascontiguousarray(values[:n] if field.name in own else values).tobytes()
    return out


def _alone(engine: str, seeds: Sequence[int], longest: float) -> dict[int, str]:
    """By a runner of one world."""
    source = load_source(TREE)
    runner = Runner(source.build(), source.scene, EngineOptions(engines=engine), longest=longest)
    physics: Any = runner.pipeline.physics
    hashes, out = _Hashes(), {}
    with hashes.watch(physics._batch):
        for seed in seeds:
            hashes.take(0)
            out[seed] = _facts(_run(runner, seed), "")
            out[seed] = f"{out[seed]} {hashes.take(0)}"
    runner.close()
    return out


def _run(runner: Runner, seed: int) -> Any:
    try:
        return runner.run(seed)
    except BtTasksimError as error:
        return error


def _in_batch(engine: str, seeds: Sequence[int], worlds: int, threads: int, longest: float) -> dict[int, str]:
    """In a batch."""
    source = load_source(TREE)
    engines = EngineOptions(engines=engine)
    runner = BatchRunner(source.build, source.scene, engines, worlds, threads, longest)
    hashes, drawn, out = _Hashes(), {}, {}
    physics: Any = runner.worlds.physics
    reset = runner.worlds.reset

    def resetting(rows: np.ndarray, configurations: Sequence[Any]) -> Any:
        for row in rows.tolist():
            hashes.take(row)
        drawn.update(zip(rows.tolist(), configurations, strict=True))
        return reset(rows, configurations)

    judged = runner._result

    def result(episode: Any, hidden: Hidden, k: int, overlap: Any) -> Any:
        row = next(r for r, other in drawn.items() if other is episode.configuration)
        out[episode.seed] = hashes.take(row)
        return judged(episode, hidden, k, overlap)

    with (
        hashes.watch(physics),
        mock.patch.object(runner.worlds, "reset", resetting),
        mock.patch.object(runner, "_result", result),
    ):
        found = {seed: _facts(result, out.get(seed, "")) for seed, result in runner.run(seeds)}
    runner.close()
    return found


def _facts(result: Any, states: str) -> str:
    if isinstance(result, BtTasksimError):
        return f"{type(result).__name__} {result}"
    verdict = result.verdict
    errors = (verdict.position_error, verdict.angle_error, verdict.penetration)
    return f"{result.status.name} {result.why} {result.control_steps} {errors!r} {states}".rstrip()


# ---- under Ray --------------------------------------------------------------------------------------------


def _outcomes(outcomes: Sequence[Any]) -> dict[int, str]:
    return {o.seed: repr(dataclasses.replace(o, wall_time=0.0).to_data()) for o in outcomes}


def _on_ray(job: Job, seeds: Sequence[int], actors: int, kill: bool) -> dict[int, str]:
    count = 0

    def ended(outcome: Any) -> None:
        nonlocal count
        count += 1
        if kill and count == len(seeds) // 3:
            os.kill(next(_members()).pid, signal.SIGKILL)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BtTasksimWarning)
        return _outcomes(evaluate(job, seeds, actors, ended, cluster="local").outcomes)


def _members() -> Iterator[psutil.Process]:
    """Actors of the cluster that this process has started."""
    for process in psutil.Process().children(recursive=True):
        if "Member" in process.name() or any("ray::Member" in word for word in process.cmdline()):
            yield process
