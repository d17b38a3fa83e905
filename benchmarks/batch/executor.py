"""The executor alone: one tick of many trees of 19 nodes, whose leaves only count, beside py_trees' own.

Worlds are either in step, all at the same place of the tree, or spread over it. NumPy, torch and py_trees
take turns, with one thread each; each number is the median over rounds of the mean over a tree's way from its
beginning to its end.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim import trees
from bt_tasksim.concept.context import Context
from bt_tasksim.core.batch_leaf import RUNNING, SUCCESS, BatchLeaf
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.batch import BatchTree
from bt_tasksim.robot.description import load_robot
from bt_tasksim.trees.nodes.batch import Arrays
from bt_tasksim.trees.walk import nodes_of

WORLDS = (1, 16, 256, 4096, 65536)
MOST_OF_PY_TREES = 4096
"""Trees of py_trees that fit into some memory and time."""
BAR_MS = 1.0
"""For 4,096 trees in NumPy."""


def options(parser: argparse.ArgumentParser) -> None:
    """What the section takes."""


class Idle(Behaviour):
    """Succeeds in its so-manieth tick."""

    def __init__(self, ticks: int) -> None:
        super().__init__(f"idle {ticks}")
        self.ticks, self.ticked = ticks, 0

    def initialise(self) -> None:
        """Begin to count."""
        self.ticked = 0

    def update(self) -> Status:
        """Count."""
        self.ticked += 1
        return Status.SUCCESS if self.ticked >= self.ticks else Status.RUNNING


class BatchIdle(BatchLeaf):
    """The same in many worlds at once."""

    def __init__(self, ticks: int, arrays: Arrays) -> None:
        self.xp, self.ticks, self.ticked = arrays.xp, ticks, arrays.full(0, "int32")
        self.running = arrays.xp.asarray(RUNNING, dtype=arrays.xp.int8, device=arrays.device)
        self.success = arrays.xp.asarray(SUCCESS, dtype=arrays.xp.int8, device=arrays.device)

    def tick(self, rows: Array, fresh: Array) -> Array:
        """Count."""
        ticked = self.ticked[rows] * ~fresh + 1
        self.ticked[rows] = ticked
        return self.xp.where(ticked >= self.ticks, self.success, self.running)


def build() -> Behaviour:
    """A tree of 19 nodes, as people write them for picking and placing."""
    return trees.sequence(
        "root",
        trees.retry(
            3,
            trees.sequence("fetch", trees.timeout(60.0, trees.fallback("grasp", Idle(8), Idle(3))), Idle(6)),
        ),
        trees.parallel("carry", Idle(9), trees.invert(trees.force_failure(Idle(7)))),
        trees.repeat(2, trees.sequence("press", Idle(2), Idle(2))),
        Idle(5),
        Idle(4),
    )


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """One tick of many trees, in milliseconds, by library, how worlds stand, and their number."""
    rounds, counts = (3, (1, 256, 4096)) if options.quick else (7, WORLDS)
    counts = (options.worlds,) if options.worlds else counts
    out: dict[str, Any] = {"nodes": len(nodes_of(build())), "ms": {}}
    for spread in (False, True):
        table = out["ms"]["spread" if spread else "in step"] = {}
        for worlds in counts:
            sides = {"NumPy": _batch(worlds, spread, np, None)}
            torch = _torch(options.device)
            if torch is not None:
                sides[f"torch, {options.device}"] = _batch(worlds, spread, torch, options.device)
            if worlds <= MOST_OF_PY_TREES:
                sides["py_trees"] = _py_trees(worlds, spread)
            taken: dict[str, list[float]] = {name: [] for name in sides}
            for _ in range(rounds):
                for name, tick in sides.items():
                    taken[name].append(_mean(tick, ticks=10 if options.quick and name == "py_trees" else 45))
            table[str(worlds)] = {name: statistics.median(ms) for name, ms in taken.items()}
    _print(out)
    return out


def _mean(tick: Callable[[], None], ticks: int) -> float:
    tick()
    started = time.process_time()
    for _ in range(ticks):
        tick()
    return (time.process_time() - started) / ticks * 1000.0


def _torch(device: str) -> Any:
    try:
        import torch
    except ImportError:
        return None
    try:
        torch.set_num_threads(1)
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        said = str(error).splitlines()[0]
        raise InputError(f"torch cannot use the device '{device}': {said}") from error
    return torch


def _before(worlds: int, spread: bool) -> list[np.ndarray]:
    """Who is ticked beforehand, so that worlds stand elsewhere in the tree."""
    if not spread:
        return []
    ahead = np.random.default_rng(0).integers(0, 45, worlds)
    return [np.flatnonzero(ahead > k) for k in range(45)]


def _batch(worlds: int, spread: bool, xp: Any, device: str | None) -> Callable[[], None]:
    arrays = Arrays(worlds, xp, device)

    def leaf(node: Behaviour) -> BatchLeaf | None:
        return BatchIdle(node.ticks, arrays) if isinstance(node, Idle) else None

    tree = BatchTree(build(), worlds, leaf, xp=xp, device=device)

    def rows(numbers: np.ndarray) -> Array:
        return arrays.xp.asarray(numbers, device=device)

    for some in _before(worlds, spread):
        tree.tick(rows(some), 0.0)
    everyone = rows(np.arange(worlds))

    def tick() -> None:
        tree.tick(everyone, 0.0)
        if device == "cuda":
            xp.cuda.synchronize()

    return tick


def _py_trees(worlds: int, spread: bool) -> Callable[[], None]:
    context = Context(load_robot("panda"))
    made = [build() for _ in range(worlds)]
    for tree in made:
        for node in tree.iterate():
            node.setup(context=context)
    for some in _before(worlds, spread):
        for world in some:
            made[world].tick_once()

    def tick() -> None:
        for tree in made:
            tree.tick_once()

    return tick


def _print(found: dict[str, Any]) -> None:
    print(f"One tick of N trees of {found['nodes']} nodes, ms")
    for how, table in found["ms"].items():
        print(f"\n{how:>12}" + "".join(f"{name:>14}" for name in next(iter(table.values()))))
        for worlds, row in table.items():
            print(f"{worlds:>12}" + "".join(f"{ms:14.3f}" for ms in row.values()))
    print(f"\nbar: 4096 trees in NumPy in at most {BAR_MS:g} ms")
