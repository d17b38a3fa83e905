"""Chores in which things are tipped up, laid down, and turned where they stand."""

from __future__ import annotations

import numpy as np

from benchmarks.chores.carrying import thing
from benchmarks.chores.chore import Chore, Slot, kind
from bt_tasksim.concept_nodes import Grasp, LayDown, Release, Spin, TipUp
from bt_tasksim.scene import Goal, ObjectSpec, SpotSpec


def _long(
    slot: Slot, kinds: tuple[str, ...], least: tuple[float, ...], most: tuple[float, ...]
) -> ObjectSpec:
    return ObjectSpec(
        kinds=kinds,
        on="table",
        centre=slot.on_table(0.0, 0.0),
        area=(0.03, 0.03),
        size=(least, most),
        mass=(0.1, 0.3),
    )


@kind()
def tip_up(slot: Slot, rng: np.random.Generator) -> Chore:
    """A long block onto its end."""
    name = f"{slot.name}_block"
    return Chore(
        "tip_up",
        name,
        lambda: [Grasp(name), TipUp(name), Release(name)],
        [Goal(name, relation="on_end")],
        {name: _long(slot, ("box",), (0.17, 0.036, 0.034), (0.22, 0.052, 0.05))},
    )


@kind()
def lay_down(slot: Slot, rng: np.random.Generator) -> Chore:
    """What stands on its end."""
    name = f"{slot.name}_tall"
    return Chore(
        "lay_down",
        name,
        lambda: [Grasp(name), LayDown(name), Release(name)],
        [Goal(name, relation="lying")],
        {name: _long(slot, ("box", "cylinder"), (0.042, 0.036, 0.15), (0.06, 0.056, 0.2))},
    )


@kind()
def spin(slot: Slot, rng: np.random.Generator) -> Chore:
    """Where it stands, to the heading of a mark."""
    name, mark = f"{slot.name}_thing", f"{slot.name}_mark"
    return Chore(
        "spin",
        f"{name} like {mark}",
        lambda: [Grasp(name), Spin(name, like=mark), Release(name)],
        [Goal(name, mark)],
        {name: thing(slot, 0.0, "box", "oval", wide=0.0)},
        spots=[SpotSpec(mark, "table", slot.on_table(0.0, 0.0), (0.0, 0.0), yaw=1.5)],
    )
