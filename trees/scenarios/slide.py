"""Wipe: take a sponge, press it on the table, and lead it past three marked spots."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Place, Release, Slide
from bt_tasksim.scene import Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import sequence

SPOTS = ("first", "second", "third")


def scene(robot: str = "panda") -> Scene:
    """A sponge, and three spots that it has to come by, in the hand and on the table."""
    at = ((0.06, -0.04), (-0.06, 0.06), (0.06, 0.16))
    return Scene(
        robot,
        objects={
            "sponge": ObjectSpec(
                kinds=("sponge",),
                on="table",
                centre=(-0.02, -0.18),
                area=(0.06, 0.05),
                mass=(0.02, 0.08),
                friction=(0.4, 0.9),
            )
        },
        spots=[
            SpotSpec(name, on="table", centre=centre, area=(0.03, 0.03), extent=(0.06, 0.06))
            for name, centre in zip(SPOTS, at, strict=True)
        ],
        goals=[Goal("sponge", name, relation="pressed", when="once") for name in SPOTS],
        name="slide",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "wipe",
        Grasp("sponge"),
        *(Slide("sponge", to=name, name=f"wipe to {name}") for name in SPOTS),
        Place("sponge", anywhere=True),
        Release("sponge"),
    )
