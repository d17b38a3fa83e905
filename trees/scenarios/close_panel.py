"""Slide a panel shut between its rails, and let it go."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import CloseDrawer, Grasp, Release
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A cupboard with a panel that is open; sizes, place, handle and friction are drawn."""
    stands = {"value": (0.08, 0.15), "x": (0.58, 0.64), "heading": (-0.15, 0.15)}
    return Scene(
        robot,
        fixtures=[FixtureSpec("panel", parameters=stands)],
        goal=Goal("panel", relation="shut"),
        name="close_panel",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "close the panel",
        Grasp("panel"),
        CloseDrawer("panel"),
        Release("panel"),
    )
