"""Pull or push a half-open drawer to where it should be, and let it go."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import AdjustDrawer, Grasp, Release
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A chest with a drawer that is half open; its sizes, place, handle and friction are drawn."""
    stands = {"value": (0.03, 0.17), "x": (0.66, 0.72), "heading": (-0.15, 0.15)}
    return Scene(
        robot,
        fixtures=[FixtureSpec("drawer", parameters=stands)],
        goal=Goal("drawer", relation="set", value=0.10, position_tolerance=0.01),
        name="adjust_drawer",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "adjust the drawer",
        Grasp("drawer"),
        AdjustDrawer("drawer", distance=0.10),
        Release("drawer"),
    )
