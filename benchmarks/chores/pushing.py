"""Chores in which things stay on what they stand on, or go into it."""

from __future__ import annotations

import numpy as np

from benchmarks.chores.carrying import thing
from benchmarks.chores.chore import Chore, Slot, kind
from bt_tasksim.concept_nodes import (
    Grasp,
    Insert,
    Pick,
    Place,
    Pull,
    Push,
    Release,
    Slide,
    SlideOff,
    SlideToStop,
)
from bt_tasksim.scene import FixtureSpec, Goal, ObjectSpec, SpotSpec
from bt_tasksim.trees import retry


def _spot(name: str, slot: Slot, x: float, y: float) -> SpotSpec:
    return SpotSpec(name, "table", slot.on_table(x, y), (0.01, 0.02), extent=(0.06, 0.06))


@kind()
def push(slot: Slot, rng: np.random.Generator) -> Chore:
    """Across, onto a marked spot."""
    name, goal = f"{slot.name}_thing", f"{slot.name}_spot"
    side = 0.08 if rng.random() < 0.5 else -0.08
    return Chore(
        "push",
        f"{name} onto a spot",
        lambda: [retry(3, Push(name, to=goal), name=f"push {name}")],
        [Goal(name, goal, relation="anywhere")],
        {name: thing(slot, -side, "box", "cube", "cylinder", "can", wide=0.02)},
        spots=[_spot(goal, slot, 0.0, side)],
    )


@kind()
def pull(slot: Slot, rng: np.random.Generator) -> Chore:
    """Nearer to the robot, onto a marked spot."""
    name, goal = f"{slot.name}_thing", f"{slot.name}_spot"
    return Chore(
        "pull",
        f"{name} onto a spot",
        lambda: [retry(3, Pull(name, to=goal), name=f"pull {name}")],
        [Goal(name, goal, relation="anywhere")],
        {name: thing(slot, 0.0, "box", "cube", "cylinder", "can", x=0.06, wide=0.02)},
        spots=[_spot(goal, slot, -0.10, 0.0)],
    )


@kind()
def wipe(slot: Slot, rng: np.random.Generator) -> Chore:
    """Past two marked spots with a sponge."""
    sponge, spots = f"{slot.name}_sponge", [f"{slot.name}_{word}_spot" for word in ("first", "second")]
    return Chore(
        "wipe",
        f"with {sponge}",
        lambda: [
            Grasp(sponge),
            *(Slide(sponge, to=spot) for spot in spots),
            Place(sponge, anywhere=True),
            Release(sponge),
        ],
        [Goal(sponge, spot, relation="pressed", when="once") for spot in spots],
        {sponge: thing(slot, -0.08, "sponge", wide=0.02)},
        spots=[_spot(spots[0], slot, 0.02, 0.0), _spot(spots[1], slot, -0.02, 0.10)],
    )


@kind()
def insert(slot: Slot, rng: np.random.Generator) -> Chore:
    """A peg into a hole."""
    peg, block = f"{slot.name}_peg", f"{slot.name}_block"
    x, y = slot.centre
    return Chore(
        "insert",
        f"{peg} into a hole",
        lambda: [Grasp(peg), Pick(peg, distance=0.1), Insert(peg, into=f"{block}_hole"), Release(peg)],
        [Goal(peg, f"{block}_hole", relation="inserted", position_tolerance=0.01)],
        {peg: thing(slot, -0.09, "peg", wide=0.02)},
        [FixtureSpec("peg_block", at=(x, y + 0.08), area=(0.01, 0.01), yaw=(-0.4, 0.4), name=block)],
    )


@kind(front=True)
def slide_to_stop(slot: Slot, rng: np.random.Generator) -> Chore:
    """Along a board against its rim, and off that again."""
    block, ledge = f"{slot.name}_block", f"{slot.name}_ledge"
    lies = ObjectSpec(
        kinds=("box", "cube"),
        on=ledge,
        centre=(-0.01, 0.0),
        area=(0.05, 0.10),
        yaw=0.3,
        size=((0.042, 0.042, 0.045), (0.055, 0.060, 0.075)),
    )
    return Chore(
        "slide_to_stop",
        f"{block} against {ledge}, and off it",
        lambda: [
            Grasp(block, closing=(0.0, 1.0, 0.0)),
            SlideToStop(block, direction=(1.0, 0.0, 0.0), distance=0.25, against=ledge),
            SlideOff(block, direction=(-1.0, 0.0, 0.0), distance=0.08),
            Place(block, anywhere=True),
            Release(block),
        ],
        [
            Goal(block, ledge, relation="held_against", when="once"),
            Goal(block, ledge, relation="anywhere"),
        ],
        {block: lies},
        [FixtureSpec("ledge", at=(slot.centre[0] - 0.08, slot.centre[1]), area=(0.02, 0.02), name=ledge)],
    )
