"""Slide a block along a board against its rim, away from there, and leave it on a marked spot."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Place, Release, SlideOff, SlideToStop
from bt_tasksim.scene import Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence

FORWARD, BACK = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)


def scene(robot: str = "panda") -> Scene:
    """A board with a rim, and a block on it."""
    return Scene(
        robot,
        fixtures=["ledge"],
        objects={
            "block": ObjectSpec(
                kinds=("box", "cube"),
                on="ledge",
                centre=(-0.01, 0.0),
                area=(0.05, 0.12),
                yaw=0.3,
                size=((0.042, 0.042, 0.045), (0.055, 0.060, 0.075)),
            )
        },
        goals=[
            Goal("block", "ledge", relation="held_against", when="once"),
            Goal("block", "ledge", relation="anywhere"),
        ],
        name="slide_to_stop",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "against the rim and off it",
        Grasp("block", closing=(0.0, 1.0, 0.0)),
        SlideToStop("block", direction=FORWARD, distance=0.25, against="ledge"),
        SlideOff("block", direction=BACK, distance=0.08),
        Place("block", anywhere=True),
        Release("block"),
    )
