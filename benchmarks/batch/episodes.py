"""Whole episodes of ``pick_and_place`` in batches: control steps per second, and where the time goes.

ManiSkill's ``PickCube-v1`` is measured in turns with them, in a process of its own. Every control step of
every world counts, those included in which things come to rest, and so does what it takes to begin an
episode. With one thread a step's time is split into PhysX's own steps, the beginning of episodes (draws,
scenes), and all the rest, which is what is outside physics. With ``--processes 2`` each has a batch of its
own, and ManiSkill is measured at its best on as many: one process, or several (``SubprocVecEnv``).
"""

from __future__ import annotations

import argparse
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
from bt_tasksim.trees.load import load_source

WORLDS = (1, 64, 256)
OUTSIDE_US = {1: 1200.0, 64: 110.0, 256: 70.0}
"""At most so many microseconds a control step and world are outside physics, by worlds."""
RATIO = {1: 4.3, 2: 7.0}
"""At least so many times ManiSkill's control steps per second, by cores."""
PEER_STEPS = 300


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
    print("us a control step and world, with one thread; bars of outside are for a machine 1.5 to 2 times")
    print("as fast as the one on which docs/batches.md was measured")
    print(
        f"{'worlds':>8}{'steps/s':>10}{'ratio':>8}{'physics':>10}{'beginning':>11}{'outside':>10}{'bar':>7}"
    )
    try:
        for worlds in WORLDS:
            found = out[str(worlds)] = _measured(worlds, options, peer)
            ratio = f"{found['ratio']:8.2f}" if "ratio" in found else f"{'':>8}"
            print(
                f"{worlds:8}{found['steps_per_s']:10.0f}{ratio}"
                + "".join(
                    f"{found[name]:{width}.1f}" if name in found else " " * width
                    for name, width in (("physics_us", 10), ("beginning_us", 11), ("outside_us", 10))
                )
                + f"{OUTSIDE_US[worlds]:7.0f}",
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
    """A batch of worlds, and what comes next in it.

    Args:
        worlds: How many.
        threads: How many threads step them.
    """

    def __init__(self, worlds: int, threads: int) -> None:
        source = load_source("pick_and_place")
        self.threads = threads
        self.runner = BatchRunner(source.build, source.scene, worlds=worlds, threads=threads)
        list(self.runner.run(range(10**6, 10**6 + min(worlds, 4))))  # whatever is made but once


def play(kept: Episodes, shares: Sequence[range], /) -> Iterator[tuple[int, dict[str, float]]]:
    """Shares of the episodes of a round: what they took."""
    for index, seeds in enumerate(shares):
        yield index, _round(kept.runner, seeds, kept.threads)


def _measured(worlds: int, options: argparse.Namespace, peer: Peer) -> dict[str, float]:
    """Medians over rounds, in each of which every world has two episodes."""
    processes, threads = options.processes, options.threads
    episodes, rows = max(2 * worlds, 4), []
    with Workers(partial(Episodes, worlds, threads), processes, "spawn") as fleet:
        list(fleet.spread(play, [range(2)] * processes))  # each has begun
        for k in range(2 if options.quick else 5):
            first = k * processes * episodes
            shares = [range(first + n * episodes, first + (n + 1) * episodes) for n in range(processes)]
            started = time.perf_counter()
            found = [row for _, row in fleet.spread(play, shares)]
            rows.append(_together(found, time.perf_counter() - started))
            if not peer.missing:
                best = max(rate(PEER_STEPS) for rate in _ways(peer, max(threads, processes)))
                rows[-1] |= {"peer_steps_per_s": best, "ratio": rows[-1]["steps_per_s"] / best}
    return {name: statistics.median(row[name] for row in rows) for name in rows[0]}


def _together(found: Sequence[dict[str, float]], seconds: float) -> dict[str, float]:
    """What processes did side by side in so many seconds."""
    out = {name: statistics.fmean(row[name] for row in found) for name in found[0] if name != "steps"}
    return out | {"steps_per_s": sum(row["steps"] for row in found) / seconds}


def _ways(peer: Peer, cores: int) -> list[Callable[[int], float]]:
    """How ManiSkill can be run on so many cores."""
    ways: list[Callable[[int], float]] = [peer.bare]
    if cores > 1:
        ways.append(lambda n: peer.steps(cores, n))
    return ways


def _round(runner: BatchRunner, seeds: range, threads: int) -> dict[str, float]:
    """One round; with several threads PhysX's steps overlap, and only the whole is told."""
    before = runner.control_steps
    if threads > 1:
        for _ in runner.run(seeds):
            pass
        return {"steps": runner.control_steps - before}
    use_software_driver()
    from sapien import physx

    spent = {"physics": 0.0, "beginning": 0.0}
    step, begin = physx.PhysxCpuSystem.step, runner.worlds.reset

    def timed(call: Callable[..., Any], part: str) -> Callable[..., Any]:
        def inner(*arguments: Any) -> Any:
            started = time.perf_counter()
            try:
                return call(*arguments)
            finally:
                spent[part] += time.perf_counter() - started

        return inner

    started = time.perf_counter()
    with (
        mock.patch.object(physx.PhysxCpuSystem, "step", timed(step, "physics")),
        mock.patch.object(runner.worlds, "reset", timed(begin, "beginning")),
    ):
        for _ in runner.run(seeds):
            pass
    total, steps = time.perf_counter() - started, runner.control_steps - before
    parts = {
        "physics_us": spent["physics"],
        "beginning_us": spent["beginning"],
        "outside_us": total - spent["beginning"] - spent["physics"],
    }
    return {"steps": steps, **{name: 1e6 * value / steps for name, value in parts.items()}}
