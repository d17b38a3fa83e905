"""Turn a knob farther than a wrist turns: grasp, turn and let go, and once more where the range ended."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Release, TurnKnob
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.resting_hand import console_at

ANGLES = (1.6, 3.2, 4.8)
"""Radians to which it is turned, one grasp after the other."""


def scene(robot: str = "panda") -> Scene:
    """A knob that turns by 5.6 rad, on a console; sizes, place and friction are drawn."""
    return Scene(
        robot,
        fixtures=[
            FixtureSpec("knob", parameters={"turns": 5.6, "x": console_at(robot), "heading": (-0.2, 0.2)})
        ],
        goal=Goal("knob", relation="set", value=ANGLES[-1], angle_tolerance=0.12),
        name="turn_far",
    )


def build() -> Behaviour:
    """The tree; each grasp is chosen so that the arm can turn on from there."""
    parts: list[Behaviour] = []
    for angle in ANGLES:
        parts += [
            Grasp("knob", name=f"take the knob to turn it to {angle}"),
            TurnKnob("knob", angle=angle, name=f"turn the knob to {angle}"),
            Release("knob", name=f"let go of the knob at {angle}"),
        ]
    return sequence("turn the knob far", *parts)
