"""Push a drawer shut, and let it go."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import CloseDrawer, Grasp, Release
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A chest with a drawer that is open; its sizes, place, handle and friction are drawn."""
    stands = {"value": (0.08, 0.18), "x": (0.66, 0.72), "heading": (-0.15, 0.15)}
    return Scene(
        robot,
        fixtures=[FixtureSpec("drawer", parameters=stands)],
        goal=Goal("drawer", relation="shut"),
        name="close_drawer",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "close the drawer",
        Grasp("drawer"),
        CloseDrawer("drawer"),
        Release("drawer"),
    )
