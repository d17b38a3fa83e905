"""Whole episodes of ``pick_and_place`` if beginning a concept took no time: an oracle of what planning costs.

The same episodes run twice: once as they are, in which what each concept begins with (its grasp, its way) is
written down, and once in which that is given back instead of being looked for. Everything else is as it was,
so they have the same control steps. With ``--beside FOLDER`` the batch of another checkout, such as one of an
older commit, runs the same seeds in turns with both, in a process of its own; and it says how fast that one
would be if it had this PhysX: all else that has been added since would then be free.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from benchmarks.batch.begins_worker import measured
from benchmarks.batch.episodes import Episodes
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.core.errors import InputError, MachineError, NoWayError
from bt_tasksim.engines.vulkan import use_software_driver

WORLDS = 64
ROUNDS = 5
WORKER = Path(__file__).with_name("begins_worker.py")


def options(parser: argparse.ArgumentParser) -> None:
    """What the section takes."""
    parser.add_argument("--beside", type=Path, metavar="FOLDER", help="another checkout to compare (begins)")


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """Control steps a second as it is and with free begins, microseconds of PhysX, and the other's."""
    worlds, rounds = options.worlds or (8 if options.quick else WORLDS), 1 if options.quick else ROUNDS
    print(f"\npick_and_place in batches of {worlds}, medians of {rounds} round(s), one thread")
    rows: list[dict[str, float]] = []
    use_software_driver()
    with ExitStack() as stack:
        other = None if options.beside is None else stack.enter_context(_Other(options.beside, worlds))
        episodes = Episodes(worlds, 1)
        for k in range(-1, rounds):  # the first one makes whatever is made but once
            seeds = range((k + 1) * worlds, (k + 2) * worlds)
            row = _round(episodes, seeds)
            if other is not None:
                row["beside_per_s"], row["beside_physics_us"] = other.measured(seeds)
            if k >= 0:
                rows.append(row)
    found = {name: statistics.median(row[name] for row in rows) for name in rows[0]}
    print(f"{'':20}{'steps/s':>10}{'PhysX, us a step':>18}{'ratio':>8}")
    if other is not None:
        print(f"{'beside':20}{found['beside_per_s']:10.0f}{found['beside_physics_us']:18.0f}{1.0:8.2f}")
        for row in rows:
            more = row["physics_us"] - row["beside_physics_us"]
            row["beside_with_physics_per_s"] = 1e6 / (1e6 / row["beside_per_s"] + more)
        found["beside_with_physics_per_s"] = statistics.median(
            row["beside_with_physics_per_s"] for row in rows
        )
        for name in ("steps_per_s", "free_begins_per_s", "beside_with_physics_per_s"):
            found[f"{name}_ratio"] = statistics.median(row[name] / row["beside_per_s"] for row in rows)
    for label, name in (
        ("as it is", "steps_per_s"),
        ("with free begins", "free_begins_per_s"),
        ("beside, this PhysX", "beside_with_physics_per_s"),
    ):
        if name not in found:
            continue
        ratio = f"{found[f'{name}_ratio']:8.2f}" if other is not None else ""
        print(f"{label:20}{found[name]:10.0f}{found['physics_us']:18.0f}{ratio}")
    return found


def _round(episodes: Episodes, seeds: range) -> dict[str, float]:
    """The same seeds with what begins written down, as they are, with free begins, and with PhysX timed."""
    tape: list[Any] = []
    steps = _with_begins(episodes, seeds, lambda begin, seen: _written(tape, begin, seen))
    again, rate, physics = measured(episodes, seeds)
    played = iter(tape)
    started = time.perf_counter()
    free = _with_begins(episodes, seeds, lambda begin, seen: _given(played))
    without = time.perf_counter() - started
    if not steps == again == free:
        raise MachineError(f"not the same episodes: {steps}, {again} and {free} control steps")
    return {"steps_per_s": rate, "free_begins_per_s": steps / without, "physics_us": physics}


def _with_begins(episodes: Episodes, seeds: range, instead: Callable[[Any, Any], Any]) -> int:
    """Run seeds with something else in place of what concepts begin with; how many control steps they had."""
    with ExitStack() as stack:
        for leaf in episodes.runner.tree.iterate():
            if isinstance(leaf, ConceptNode):
                begin = leaf.model.begin
                object.__setattr__(leaf.model, "begin", lambda seen, begin=begin: instead(begin, seen))
                stack.callback(object.__delattr__, leaf.model, "begin")
        return episodes.whole(seeds)


def _written(tape: list[Any], begin: Callable[[Any], Any], seen: Any) -> Any:
    try:
        tape.append(begin(seen))
    except NoWayError as error:
        tape.append(error)
        raise
    return tape[-1]


def _given(tape: Iterator[Any]) -> Any:
    found = next(tape)
    if isinstance(found, NoWayError):
        raise found
    return found


class _Other:
    """Another checkout's batch, in a process of its own."""

    def __init__(self, folder: Path, worlds: int) -> None:
        if not (folder / "benchmarks" / "batch" / "episodes.py").is_file():
            raise InputError(f"'{folder}' is no checkout with benchmarks/batch/episodes.py")
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(WORKER), str(worlds)],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(folder.resolve())},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def measured(self, seeds: range) -> tuple[float, float]:
        """Control steps a second with some seeds, and microseconds of PhysX a control step."""
        assert self._process.stdin is not None and self._process.stdout is not None
        print(seeds.start, seeds.stop, file=self._process.stdin, flush=True)
        for line in self._process.stdout:
            if line.startswith("measured "):
                _, rate, physics = map(float, line.split()[1:])
                return rate, physics
        raise MachineError("the other checkout's batch has ended before it was measured")

    def __enter__(self) -> _Other:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()
