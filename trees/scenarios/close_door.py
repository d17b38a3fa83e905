"""Turn a door shut, and let it go."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import CloseDoor, Grasp, Release
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.resting_hand import farther_out

WIDE = 0.8
"""Radians beyond which a door does not stand open before a hand that rests farther out."""


def open_door(robot: str, value: tuple[float, float]) -> FixtureSpec:
    """A door that stands open, farther off and no wider than `WIDE` where the robot's hand rests far out.

    Args:
        robot: The robot that is to close or adjust it.
        value: Between which angles it is drawn, radians.
    """
    farther = farther_out(robot)
    drawn = (value[0], min(value[1], WIDE)) if farther else value
    stands = {"value": drawn, "x": (0.66 + farther, 0.72 + farther), "heading": (-0.2, 0.2)}
    return FixtureSpec("door", parameters=stands)


def scene(robot: str = "panda") -> Scene:
    """A cabinet with a door that is open; its sizes, place, handle and friction are drawn."""
    return Scene(
        robot,
        fixtures=[open_door(robot, value=(0.5, 1.1))],
        goal=Goal("door", relation="shut"),
        name="close_door",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "close the door",
        Grasp("door"),
        CloseDoor("door"),
        Release("door"),
    )
