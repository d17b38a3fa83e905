"""Fill a cup from a jug, and put both where they belong."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Pour, Release
from bt_tasksim.scene import Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import recovering, sequence

BALLS = tuple(f"ball_{k}" for k in range(1, 6))
LEAST, MOST = (0.010, 0.010, 0.010), (0.012, 0.012, 0.012)
COASTER = (0.06, 0.06)
"""Metres of the coaster, on which the jug's middle comes to be, with any heading."""


def scene(robot: str = "panda") -> Scene:
    """A jug with balls in it, a cup somewhere else, a saucer for the cup and a coaster for the jug."""
    jug = ObjectSpec(kinds=("jug",), on="table", centre=(0.0, -0.22), area=(0.04, 0.04), mass=(0.1, 0.2))
    cup = ObjectSpec(kinds=("cup",), on="table", centre=(0.08, 0.26), area=(0.04, 0.04), mass=(0.1, 0.2))
    ball = ObjectSpec(
        kinds=("ball",),
        inside="jug",
        centre=(-0.009, 0.0),
        area=(0.018, 0.018),
        gap=0.001,
        size=(LEAST, MOST),
        mass=(0.002, 0.004),
    )
    return Scene(
        robot,
        objects={"jug": jug, "cup": cup, **dict.fromkeys(BALLS, ball)},
        spots=[
            SpotSpec("saucer", on="table", centre=(0.0, 0.08), area=(0.03, 0.03)),
            SpotSpec("coaster", on="table", centre=(0.0, -0.22), area=(0.04, 0.04), extent=COASTER),
        ],
        goals=[
            *(Goal(ball, inside="cup") for ball in BALLS),
            Goal("cup", "saucer"),
            Goal("jug", "coaster", relation="anywhere"),
        ],
        name="pour_a_cup",
    )


def build() -> Behaviour:
    """The tree: eleven tasks; what goes wrong is put right."""
    return recovering(
        sequence(
            "pour a cup",
            Grasp("cup"),
            Pick("cup"),
            Bring("cup", to="saucer"),
            Place("cup", on="saucer"),
            Release("cup"),
            Grasp("jug"),
            Pick("jug", distance=0.1),
            Pour("jug", into="cup"),
            Bring("jug", to="coaster"),
            Place("jug", on="coaster"),
            Release("jug"),
        )
    )
