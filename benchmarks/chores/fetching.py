"""Chores of several tasks with furniture and something that goes out of it, or into it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.chores.carrying import thing
from benchmarks.chores.chore import LEFT, RIGHT, Chore, Slot, kind
from benchmarks.chores.opening import furniture
from bt_tasksim.concept_nodes import (
    Bring,
    CloseDrawer,
    Grasp,
    OpenDoor,
    OpenDrawer,
    Pick,
    Place,
    Release,
)
from bt_tasksim.scene import Goal, ObjectSpec, SpotSpec

WIDE, DEEP = (0.30, 0.34), (0.28, 0.32)
"""Metres of a drawer in which an open hand has room about what lies in it."""
FAR = 0.66
"""Metres before the robot from which on what opens wide, or all the way, is in its reach."""


def _behind(slot: Slot, y: float = 0.0) -> Slot:
    """A slot behind another one."""
    return replace(slot, centre=(FAR, y))


@kind(front=True, needs=(RIGHT,))
def fetch(slot: Slot, rng: np.random.Generator) -> Chore:
    """A cube out of a drawer, which is shut again in half of the draws."""
    name, cube, spot = (f"{slot.name}_{word}" for word in ("drawer", "cube", "spot"))
    shut = bool(rng.random() < 0.5)
    lies = ObjectSpec(
        kinds=("cube",),
        inside=name,
        size=((0.04,) * 3, (0.05,) * 3),
        centre=(-0.03, 0.0),
        area=(0.01, 0.03),
    )
    again = [Grasp, CloseDrawer, Release] if shut else []
    return Chore(
        "fetch",
        f"{cube} out of {name}{', which is shut again' if shut else ''}",
        lambda: [
            Grasp(name),
            OpenDrawer(name, distance=0.23),
            Release(name),
            Grasp(cube),
            Pick(cube, distance=0.15),
            Bring(cube, to=spot),
            Place(cube, on=spot),
            Release(cube),
            *(concept(name, name=f"{concept.__name__.lower()} {name} again") for concept in again),
        ],
        [Goal(cube, spot), *([Goal(name, relation="shut")] if shut else [])],
        {cube: lies},
        [furniture(_behind(slot), "drawer", name, rng, base=0.10, width=WIDE, depth=DEEP, opens=0.25)],
        [SpotSpec(spot, "table", RIGHT.on_table(0.0, 0.0), (0.03, 0.03))],
    )


@kind(front=True, needs=(LEFT, RIGHT))
def put_inside(slot: Slot, rng: np.random.Generator) -> Chore:
    """A cup into a cabinet behind a door."""
    name, cup = f"{slot.name}_door", f"{slot.name}_cup"
    inside = f"{name}_cabinet"
    return Chore(
        "put_inside",
        f"{cup} into {inside}",
        lambda: [
            Grasp(name),
            OpenDoor(name, angle=1.4),
            Release(name),
            Grasp(cup),
            Pick(cup, distance=0.10),
            Bring(cup, to=inside, anywhere=True),
            Place(cup, on=inside, anywhere=True),
            Release(cup),
        ],
        [Goal(cup, inside, position_tolerance=0.15), Goal(name, relation="open", value=1.2)],
        {cup: thing(RIGHT, 0.0, "cup", x=-0.04)},
        [furniture(_behind(slot, 0.10), "door", name, rng, side="left", radius=(0.25, 0.28), height=0.36)],
    )
