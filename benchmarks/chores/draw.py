"""Random tasks: chores of different kinds in different parts of one table, as functions of a seed."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from py_trees.behaviour import Behaviour

from benchmarks.chores import (  # noqa: F401  # which announce their kinds
    carrying,
    controls,
    fetching,
    opening,
    pushing,
    turning,
)
from benchmarks.chores.chore import IN_FRONT, KINDS, NEEDED, SLOTS, Chore
from bt_tasksim.core.errors import InputError
from bt_tasksim.scene import Scene
from bt_tasksim.trees import recovering, sequence

MOST = 3
"""Chores of one task."""
TRIES = 40


@dataclass(frozen=True)
class Task:
    """A task.

    Attributes:
        seed: Its seed, which is that of its scene's draw, too.
        chores: What is to be done, in order.
        scene: The scene with all goals.
    """

    seed: int
    chores: tuple[Chore, ...]
    scene: Scene

    @property
    def words(self) -> str:
        """All of it in a line."""
        return "; ".join(f"{chore.kind}: {chore.words}" for chore in self.chores)

    def tree(self, kind: str = "obvious", order: Sequence[int] | None = None) -> Behaviour:
        """A fresh tree: all chores one after the other.

        Args:
            kind: ``obvious``, or ``recovering``.
            order: Another order of the chores.
        """
        chores = self.chores if order is None else [self.chores[k] for k in order]
        tree = sequence("chores", *(leaf for chore in chores for leaf in chore.leaves()))
        if kind != "recovering":
            return tree
        try:
            return recovering(tree)
        except InputError:  # nothing tells whether any of it is done, as with buttons alone
            return tree


def task(seed: int, robot: str = "panda", kinds: Sequence[str] = ()) -> Task:
    """The task of a seed.

    Args:
        seed: The seed.
        robot: Name of the robot.
        kinds: Kinds of chores to draw from, by default all.

    Raises:
        InputError: There is no such kind, or no try fits.
    """
    known = list(kinds or KINDS)
    if unknown := [name for name in known if name not in KINDS]:
        raise InputError(f"there is no kind of chore '{unknown[0]}': take {', '.join(KINDS)}")
    rng = np.random.default_rng([int(seed), zlib.crc32(robot.encode()), zlib.crc32(b"chores")])
    last: InputError | None = None
    for _ in range(TRIES):
        try:
            return _drawn(seed, robot, known, rng)
        except InputError as error:
            last = error
    raise InputError(f"no chores for seed {seed} and {robot} in {TRIES} tries; the last one: {last}")


def _drawn(seed: int, robot: str, known: Sequence[str], rng: np.random.Generator) -> Task:
    count = int(rng.integers(1, MOST + 1))
    wanted = []
    for slot in (SLOTS[k] for k in rng.permutation(len(SLOTS))[:count]):
        fitting = [name for name in known if slot.front or name not in IN_FRONT]
        if fitting:
            wanted.append((slot, str(rng.choice(fitting))))
    taken = [slot for _, name in wanted for slot in NEEDED[name]]
    chores = [KINDS[name](slot, rng) for slot, name in wanted if slot not in taken]
    if not chores:
        raise InputError("none of these kinds of chores fits the part of the table that was drawn")
    scene = Scene(
        robot,
        fixtures=[fixture for chore in chores for fixture in chore.fixtures],
        objects={name: spec for chore in chores for name, spec in chore.objects.items()},
        spots=[spot for chore in chores for spot in chore.spots],
        goals=[goal for chore in chores for goal in chore.goals],
        name="chores",
    )
    scene.sample(seed)
    return Task(seed, tuple(chores), scene)
