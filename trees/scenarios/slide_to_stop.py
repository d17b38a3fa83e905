"""Slide a block along a board against its rim, away from there, and leave it on a marked spot."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Place, Release, SlideOff, SlideToStop
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene import Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence

FORWARD, BACK = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)

LONG = (0.075, 0.090)
"""Metres between which blocks are long for hands of many fingers: one is in front of a shorter block."""


def block_on_ledge(robot: str) -> ObjectSpec:
    """A block that is slid against the rim, no shorter than the fingers beside it are wide.

    Args:
        robot: The robot that is to slide it.
    """
    many = load_robot(robot).many_fingers
    short, long = LONG if many else (0.042, 0.055)
    return ObjectSpec(
        kinds=("box",) if many else ("box", "cube"),
        on="ledge",
        centre=(-0.01, 0.0),
        area=(0.05, 0.12),
        yaw=0.3,
        size=((short, 0.042, 0.045), (long, 0.060, 0.075)),
    )


def scene(robot: str = "panda") -> Scene:
    """A board with a rim, and a block on it."""
    return Scene(
        robot,
        fixtures=["ledge"],
        objects={"block": block_on_ledge(robot)},
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
