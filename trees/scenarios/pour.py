"""Pour what is in a jug into a bowl, and put the jug down again."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Pour, Release
from bt_tasksim.scene import Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import sequence

BALLS = tuple(f"ball_{k}" for k in range(1, 6))
LEAST, MOST = (0.010, 0.010, 0.010), (0.012, 0.012, 0.012)
COASTER = (0.06, 0.06)
"""Metres of the coaster, on which the jug's middle comes to be, with any heading."""


def scene(robot: str = "panda") -> Scene:
    """A jug with balls in it, a bowl, and a spot for the empty jug."""
    jug = ObjectSpec(kinds=("jug",), on="table", centre=(0.0, -0.16), area=(0.05, 0.04), mass=(0.1, 0.2))
    bowl = ObjectSpec(kinds=("bowl",), on="table", centre=(0.0, 0.12), area=(0.05, 0.05), mass=(0.3, 0.5))
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
        objects={"jug": jug, "bowl": bowl, **dict.fromkeys(BALLS, ball)},
        spots=[SpotSpec("coaster", on="table", centre=(0.0, -0.16), area=(0.05, 0.04), extent=COASTER)],
        goals=[*(Goal(ball, inside="bowl") for ball in BALLS), Goal("jug", "coaster", relation="anywhere")],
        name="pour",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "pour",
        Grasp("jug"),
        Pick("jug", distance=0.1),
        Pour("jug", into="bowl"),
        Bring("jug", to="coaster"),
        Place("jug", on="coaster"),
        Release("jug"),
    )
