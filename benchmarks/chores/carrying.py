"""Chores in which things are taken, carried, put down, poured and turned."""

from __future__ import annotations

import numpy as np

from benchmarks.chores.chore import Chore, Slot, kind
from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Pour, Release
from bt_tasksim.scene import Goal, ObjectSpec, SpotSpec

SOLIDS = ("box", "cylinder", "oval", "diamond", "cube")
BALLS = 3
COASTER = (0.06, 0.06)
"""Metres of the coaster, on which the jug's middle comes to be, with any heading."""


def thing(slot: Slot, y: float, *kinds: str, x: float = 0.0, wide: float = 0.03) -> ObjectSpec:
    """An object of one of these kinds, within some centimetres of a point of a slot."""
    return ObjectSpec(kinds=kinds or SOLIDS, on="table", centre=slot.on_table(x, y), area=(wide, wide))


@kind()
def carry(slot: Slot, rng: np.random.Generator) -> Chore:
    """To a marked spot."""
    name, goal = f"{slot.name}_thing", f"{slot.name}_spot"
    return Chore(
        "carry",
        f"{name} to a spot",
        lambda: [Grasp(name), Pick(name), Bring(name, to=goal), Place(name, on=goal), Release(name)],
        [Goal(name, goal)],
        {name: thing(slot, -0.08)},
        spots=[SpotSpec(goal, "table", slot.on_table(0.0, 0.08), (0.02, 0.02), yaw=0.5)],
    )


@kind()
def stack(slot: Slot, rng: np.random.Generator) -> Chore:
    """On top of a block."""
    name, block = f"{slot.name}_thing", f"{slot.name}_block"
    wide = ObjectSpec(
        kinds=("box",),
        on="table",
        centre=slot.on_table(0.0, 0.08),
        area=(0.02, 0.02),
        size=((0.09, 0.09, 0.05), (0.11, 0.11, 0.07)),
        mass=(0.3, 0.6),
    )
    return Chore(
        "stack",
        f"{name} onto {block}",
        lambda: [
            Grasp(name),
            Pick(name, distance=0.12),
            Bring(name, to=block),
            Place(name, on=block),
            Release(name),
        ],
        [Goal(name, on=block)],
        {name: thing(slot, -0.08), block: wide},
    )


@kind()
def put_beside(slot: Slot, rng: np.random.Generator) -> Chore:
    """Beside a cup."""
    name, cup = f"{slot.name}_thing", f"{slot.name}_cup"
    return Chore(
        "put_beside",
        f"{name} beside {cup}",
        lambda: [
            Grasp(name),
            Pick(name),
            Bring(name, beside=cup),
            Place(name, beside=cup),
            Release(name),
        ],
        [Goal(name, beside=cup)],
        {name: thing(slot, -0.10, wide=0.02), cup: thing(slot, 0.10, "cup", wide=0.02)},
    )


@kind()
def pour(slot: Slot, rng: np.random.Generator) -> Chore:
    """From a jug into a bowl."""
    jug, bowl, coaster = (f"{slot.name}_{word}" for word in ("jug", "bowl", "coaster"))
    balls = [f"{slot.name}_ball_{k}" for k in range(1, BALLS + 1)]
    ball = ObjectSpec(
        kinds=("ball",),
        inside=jug,
        centre=(-0.009, 0.0),
        area=(0.018, 0.018),
        gap=0.001,
        size=((0.010,) * 3, (0.012,) * 3),
        mass=(0.002, 0.004),
    )
    vessels = {jug: thing(slot, -0.10, "jug", wide=0.02), bowl: thing(slot, 0.10, "bowl", wide=0.02)}
    return Chore(
        "pour",
        f"{jug} into {bowl}",
        lambda: [
            Grasp(jug),
            Pick(jug, distance=0.1),
            Pour(jug, into=bowl),
            Bring(jug, to=coaster),
            Place(jug, on=coaster),
            Release(jug),
        ],
        [*(Goal(each, inside=bowl) for each in balls), Goal(jug, coaster, relation="anywhere")],
        {**vessels, **dict.fromkeys(balls, ball)},
        spots=[SpotSpec(coaster, "table", slot.on_table(0.0, -0.10), (0.02, 0.02), extent=COASTER)],
    )
