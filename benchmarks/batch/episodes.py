"""Whole episodes of ``pick_and_place`` in batches: control steps per second, and where the time goes.

ManiSkill's ``PickCube-v1`` is measured in turns with them, in a process of its own. Every control step of
every world counts, those included in which things come to rest, and so does what it takes to begin an
episode. A round is an evaluation, two episodes a world from the first step to the last. Then worlds go on
for ever, each with the next seed when its episode has ended, so that they are at all leaves of the tree at
once (`mixed`), which costs more: the time of a step is split there into PhysX's own steps, the rest of
stepping (drives, the overlaps that are looked for between the steps, rolling resistance), the beginning of
episodes (draws, scenes), and what is outside physics: reading states, observations, the tree, concepts and
kinematics. With ``--processes 2`` each has a batch of its own, and ManiSkill is measured at its best on as
many: one process, or several (``SubprocVecEnv``).
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any
from unittest import mock

from benchmarks.peer_maniskill import Peer
from bt_tasksim.core.workers import Workers
from bt_tasksim.engines.vulkan import use_software_driver
from bt_tasksim.execution.batch_runner import BatchRunner
from bt_tasksim.execution.runner import LONGEST
from bt_tasksim.trees.load import load_source

WORLDS = (1, 64, 256, 1024)
OUTSIDE_US = {1: 1200.0, 64: 110.0, 256: 70.0}
"""At most so many microseconds a control step and world are outside physics, by worlds."""
RATIO = {1: 4.3, 2: 7.0}
"""At least so many times ManiSkill's control steps per second, by cores."""
COLUMNS = (
    ("mixed_per_s", 8),
    ("physics_us", 10),
    ("stepping_us", 10),
    ("beginning_us", 11),
    ("outside_us", 10),
)
PEER_STEPS = 1000
QUICK_PEER_STEPS = 200


def options(parser: argparse.ArgumentParser) -> None:
    """What the section takes."""
    parser.add_argument("--threads", type=int, default=1, help="threads that step the worlds (episodes)")
    parser.add_argument("--processes", type=int, default=1, help="each with a batch of its own (episodes)")


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """Control steps per second, the ratio to ManiSkill's, and microseconds a control step and world."""
    threads, processes = options.threads, options.processes
    peer = Peer()
    out: dict[str, Any] = {"threads": threads, "processes": processes, "maniskill_missing": peer.missing}
    bar = RATIO.get(max(threads, processes))
    print(f"\nepisodes of pick_and_place, {processes} process(es) of {threads} thread(s)")
    print(
        "us a control step and world, with one thread; the bars of what is outside are for a machine on which"
    )
    print("the code before batches took 180 to 211 us, see docs/batches.md")
    print(
        f"{'worlds':>8}{'steps/s':>10}{'ratio':>8}{'mixed':>8}{'physics':>10}{'stepping':>10}{'beginning':>11}"
        f"{'outside':>10}{'bar':>7}"
    )
    try:
        for worlds in (options.worlds,) if options.worlds else WORLDS:
            found = out[str(worlds)] = measured(worlds, options, peer)
            ratio = f"{found['ratio']:8.2f}" if "ratio" in found else f"{'':>8}"
            print(
                f"{worlds:8}{found['steps_per_s']:10.0f}{ratio}"
                + "".join(
                    f"{found[name]:{width}.0f}" if name in found else " " * width for name, width in COLUMNS
                )
                + (f"{OUTSIDE_US[worlds]:7.0f}" if worlds in OUTSIDE_US else ""),
                flush=True,
            )
    finally:
        peer.close()
    if peer.missing:
        print(f"ManiSkill's PickCube-v1 does not start: {peer.missing}")
    elif bar is not None:
        print(f"the ratio is to be at least {bar:g}")
    return out


class Episodes:
    """A batch of worlds in which episodes run.

    Args:
        worlds: How many.
        threads: How many threads step them.
        longest: Simulated seconds after which an episode is stopped.
    """

    def __init__(self, worlds: int, threads: int, longest: float = LONGEST) -> None:
        source = load_source("pick_and_place")
        self.runner = BatchRunner(source.build, source.scene, worlds=worlds, threads=threads, longest=longest)
        self._for_ever: Iterator[Any] | None = None

    def whole(self, seeds: range) -> int:
        """Run all episodes of these seeds; how many control steps they had."""
        before = self.runner.control_steps
        for _ in self.runner.run(seeds):
            pass
        return self.runner.control_steps - before

    def go_on(self, steps: int) -> int:
        """Go on by so many control steps at least: a world takes the next seed when its episode has ended."""
        if self._for_ever is None:
            self._for_ever = self.runner.run(itertools.count())
        before = self.runner.control_steps
        while self.runner.control_steps < before + steps:
            next(self._for_ever)
        return self.runner.control_steps - before


def whole(kept: Episodes, shares: Sequence[range], /) -> Iterator[tuple[int, int]]:
    """Episodes of some seeds: their control steps."""
    for index, seeds in enumerate(shares):
        yield index, kept.whole(seeds)


def go_on(kept: Episodes, shares: Sequence[int], /) -> Iterator[tuple[int, int]]:
    """Go on by so many control steps; how many they were."""
    for index, steps in enumerate(shares):
        yield index, kept.go_on(steps)


def split(kept: Episodes, shares: Sequence[int], /) -> Iterator[tuple[int, dict[str, float]]]:
    """The same, and where the time went."""
    for index, steps in enumerate(shares):
        yield index, _split(kept, steps)


def measured(
    worlds: int, options: argparse.Namespace, peer: Peer, apart: bool = True, rounds: int | None = None
) -> dict[str, float]:
    """Medians over rounds, both sides in turns; ``apart``: and then where the time goes."""
    processes, threads = options.processes, options.threads
    episodes, steps, rows = max(2 * worlds, 8), 150 * max(worlds, 16), []
    peer_steps = PEER_STEPS
    if options.quick:
        episodes, steps, peer_steps = worlds, min(150, round(20 * options.longest)) * worlds, QUICK_PEER_STEPS
    with Workers(partial(Episodes, worlds, threads, options.longest), processes, "spawn") as fleet:
        list(fleet.spread(whole, [range(2)] * processes))  # whatever is made but once
        for k in range(rounds or (1 if options.quick else 5)):
            first = k * processes * episodes
            seeds = [range(first + n * episodes, first + (n + 1) * episodes) for n in range(processes)]
            rows.append({"steps_per_s": _rate(fleet.spread(whole, seeds))})
            if not peer.missing:
                best = max(rate(peer_steps) for rate in _ways(peer, max(threads, processes)))
                rows[-1] |= {"peer_steps_per_s": best, "ratio": rows[-1]["steps_per_s"] / best}
        found = {name: statistics.median(row[name] for row in rows) for name in rows[0]}
        if not apart:
            return found
        list(fleet.spread(go_on, [2 * steps] * processes))  # episodes begin at unlike times by now
        rates = [_rate(fleet.spread(go_on, [steps] * processes)) for _ in range(1 if options.quick else 3)]
        found["mixed_per_s"] = statistics.median(rates)
        if threads > 1:  # PhysX's steps overlap: only the whole is told
            return found
        parts = [part for _, part in fleet.spread(split, [steps] * processes)]
    return found | {name: statistics.fmean(part[name] for part in parts) for name in parts[0]}


def _rate(found: Iterator[tuple[int, int]]) -> float:
    """Control steps per second of what the processes do together."""
    started = time.perf_counter()
    return sum(steps for _, steps in found) / (time.perf_counter() - started)


def _ways(peer: Peer, cores: int) -> list[Callable[[int], float]]:
    """How ManiSkill can be run on so many cores."""
    ways: list[Callable[[int], float]] = [peer.bare]
    if cores > 1:
        ways.append(lambda n: peer.steps(cores, n))
    return ways


def _split(kept: Episodes, steps: int) -> dict[str, float]:
    """Microseconds a control step and world of each part; timing them takes some of its own."""
    use_software_driver()
    from sapien import physx

    from bt_tasksim.engines.physics.sapien_stepping import SapienWorld

    spent = dict.fromkeys(("physics", "stepping", "beginning"), 0.0)

    def timed(call: Callable[..., Any], part: str) -> Callable[..., Any]:
        def inner(*arguments: Any) -> Any:
            started = time.perf_counter()
            try:
                return call(*arguments)
            finally:
                spent[part] += time.perf_counter() - started

        return inner

    worlds, started = kept.runner.worlds, time.perf_counter()
    with (
        mock.patch.object(physx.PhysxCpuSystem, "step", timed(physx.PhysxCpuSystem.step, "physics")),
        mock.patch.object(SapienWorld, "drive_to", timed(SapienWorld.drive_to, "stepping")),
        mock.patch.object(SapienWorld, "advance", timed(SapienWorld.advance, "stepping")),
        mock.patch.object(worlds, "reset", timed(worlds.reset, "beginning")),
    ):
        steps = kept.go_on(steps)
    total = time.perf_counter() - started
    parts = {
        "physics_us": spent["physics"],
        "stepping_us": spent["stepping"] - spent["physics"],
        "beginning_us": spent["beginning"],
        "outside_us": total - spent["beginning"] - spent["stepping"],
    }
    return {name: 1e6 * value / steps for name, value in parts.items()}
