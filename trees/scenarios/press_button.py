"""Press a button in until it stops, and let it come back."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import PressButton
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A button on a console, on its top or on its front; sizes, place and spring are drawn."""
    stands = {"heading": (-0.2, 0.2)}
    return Scene(
        robot,
        fixtures=[FixtureSpec("button", parameters=stands)],
        goal=Goal("button", relation="open", when="once"),
        name="press_button",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence("press the button", PressButton("button"))
