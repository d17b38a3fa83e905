"""Hold a block against the rim of a board for three seconds."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Hold, Place, Release, SlideToStop
from bt_tasksim.scene import Goal, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.scenarios.slide_to_stop import block_on_ledge

FORWARD = (1.0, 0.0, 0.0)
SECONDS = 3.0
"""For how long: much longer than a block is held there that is let go at once."""


def scene(robot: str = "panda") -> Scene:
    """A board with a rim, and a block on it."""
    return Scene(
        robot,
        fixtures=["ledge"],
        objects={"block": block_on_ledge(robot)},
        goals=[
            Goal("block", "ledge", relation="held_against", when="kept", duration=SECONDS),
            Goal("block", "ledge", relation="against"),
        ],
        name="hold",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "press against the rim",
        Grasp("block", closing=(0.0, 1.0, 0.0)),
        SlideToStop("block", direction=FORWARD, distance=0.25, against="ledge"),
        Hold("block", direction=FORWARD, duration=SECONDS),
        Place("block", anywhere=True),
        Release("block"),
    )
