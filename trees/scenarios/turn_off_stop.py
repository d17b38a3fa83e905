"""Turn a lever off the stop that it leans on, and let it go."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Release, TurnOffStop
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.resting_hand import console_at


def scene(robot: str = "panda") -> Scene:
    """A lever that leans on a stop; sizes, place and friction are drawn."""
    stands = {"x": console_at(robot), "heading": (-0.2, 0.2)}
    return Scene(
        robot,
        fixtures=[FixtureSpec("lever", parameters=stands)],
        goal=Goal("lever", relation="set", value=0.7, angle_tolerance=0.08),
        name="turn_off_stop",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "turn the lever off its stop",
        Grasp("lever"),
        TurnOffStop("lever", angle=0.7),
        Release("lever"),
    )
