"""Turn the door of a cabinet open by its handle, and let it go."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, OpenDoor, Release
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A cabinet with a door that is shut; its sizes, place, handle and friction are drawn."""
    stands = {"x": (0.66, 0.72), "heading": (-0.2, 0.2)}
    return Scene(
        robot,
        fixtures=[FixtureSpec("door", parameters=stands)],
        goal=Goal("door", relation="open", value=1.2),
        name="open_door",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "open the door",
        Grasp("door"),
        OpenDoor("door", angle=1.2),
        Release("door"),
    )
