"""Turn a half-open door to where it should be, and let it go."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import AdjustDoor, Grasp, Release
from bt_tasksim.scene import Goal, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.scenarios.close_door import open_door


def scene(robot: str = "panda") -> Scene:
    """A cabinet with a door that is half open; its sizes, place, handle and friction are drawn."""
    return Scene(
        robot,
        fixtures=[open_door(robot, value=(0.3, 1.2))],
        goal=Goal("door", relation="set", value=0.8, angle_tolerance=0.06),
        name="adjust_door",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "adjust the door",
        Grasp("door"),
        AdjustDoor("door", angle=0.8),
        Release("door"),
    )
