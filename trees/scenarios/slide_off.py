"""Slide a block that stands against the rim of a board away from that, and leave it on the board."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Place, Release, SlideOff
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene import Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.scenarios.slide_to_stop import LONG

RIM = 0.1498
"""Metres from the middle of the board to a hair before its rim."""


def scene(robot: str = "panda") -> Scene:
    """A board with a rim, and a block against that."""
    length = LONG[0] if load_robot(robot).many_fingers else 0.05
    return Scene(
        robot,
        fixtures=["ledge"],
        objects={
            "block": ObjectSpec(
                kinds=("box",),
                on="ledge",
                centre=(RIM - length / 2, 0.0),
                area=(0.0, 0.12),
                yaw=0.0,
                size=((length, 0.042, 0.045), (length, 0.060, 0.075)),
            )
        },
        goals=[
            Goal("block", "ledge", relation="against", when="once"),
            Goal("block", "ledge", relation="clear_of", distance=0.05),
            Goal("block", "ledge", relation="anywhere"),
        ],
        name="slide_off",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "off the rim",
        Grasp("block"),
        SlideOff("block", off="ledge", distance=0.08),
        Place("block", anywhere=True),
        Release("block"),
    )
