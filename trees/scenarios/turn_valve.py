"""Turn a valve to where it should be, and let it go."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Release, TurnKnob
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.resting_hand import console_at


def scene(robot: str = "panda") -> Scene:
    """A valve with a wheel or a cross, on a console; sizes, place and friction are drawn."""
    stands = {"x": console_at(robot), "heading": (-0.2, 0.2)}
    return Scene(
        robot,
        fixtures=[FixtureSpec("valve", parameters=stands)],
        goal=Goal("valve", relation="set", value=1.2, angle_tolerance=0.1),
        name="turn_valve",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "turn the valve",
        Grasp("valve"),
        TurnKnob("valve", angle=1.2),
        Release("valve"),
    )
