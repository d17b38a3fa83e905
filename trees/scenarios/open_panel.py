"""Slide a panel open between its rails, and let it go."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, OpenDrawer, Release
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A cupboard with a panel that is shut; sizes, place, handle and friction are drawn."""
    stands = {"x": (0.58, 0.64), "heading": (-0.15, 0.15)}
    return Scene(
        robot,
        fixtures=[FixtureSpec("panel", parameters=stands)],
        goal=Goal("panel", relation="open", value=0.13),
        name="open_panel",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "open the panel",
        Grasp("panel"),
        OpenDrawer("panel", distance=0.14),
        Release("panel"),
    )
