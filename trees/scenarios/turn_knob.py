"""Turn a knob to where it should be, and let it go."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Release, TurnKnob
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.resting_hand import console_at


def scene(robot: str = "panda") -> Scene:
    """A knob on a console, on its top or on its front; sizes, place and friction are drawn."""
    stands = {"x": console_at(robot), "heading": (-0.2, 0.2)}
    return Scene(
        robot,
        fixtures=[FixtureSpec("knob", parameters=stands)],
        goal=Goal("knob", relation="set", value=1.5, angle_tolerance=0.08),
        name="turn_knob",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "turn the knob",
        Grasp("knob"),
        TurnKnob("knob", angle=1.5),
        Release("knob"),
    )
