"""Pull a chest's drawer open by its handle, and let it go."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, OpenDrawer, Release
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A chest with a drawer that is shut; its sizes, place, handle and friction are drawn."""
    stands = {"x": (0.66, 0.72), "heading": (-0.15, 0.15)}
    return Scene(
        robot,
        fixtures=[FixtureSpec("drawer", parameters=stands)],
        goal=Goal("drawer", relation="open", value=0.15),
        name="open_drawer",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "open the drawer",
        Grasp("drawer"),
        OpenDrawer("drawer", distance=0.15),
        Release("drawer"),
    )
