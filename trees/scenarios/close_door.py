"""Turn a door shut, and let it go."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import CloseDoor, Grasp, Release
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A cabinet with a door that is open; its sizes, place, handle and friction are drawn."""
    stands = {"value": (0.5, 1.1), "x": (0.66, 0.72), "heading": (-0.2, 0.2)}
    return Scene(
        robot,
        fixtures=[FixtureSpec("door", parameters=stands)],
        goal=Goal("door", relation="shut"),
        name="close_door",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "close the door",
        Grasp("door"),
        CloseDoor("door"),
        Release("door"),
    )
