"""Put a thing beside another one, wherever that stands."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Release
from bt_tasksim.scene import Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A thing of one of four shapes, and another one across the table."""
    return Scene(
        robot,
        objects={
            "target": ObjectSpec(
                kinds=("box", "cylinder", "oval", "diamond"),
                on="table",
                centre=(0.0, -0.16),
                area=(0.08, 0.08),
            ),
            "other": ObjectSpec(
                kinds=("box", "cup", "can"), on="table", centre=(0.0, 0.16), area=(0.08, 0.08)
            ),
        },
        goal=Goal("target", beside="other"),
        name="place_beside",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "put it beside the other",
        Grasp("target"),
        Pick("target", distance=0.1),
        Bring("target", beside="other"),
        Place("target", beside="other"),
        Release("target"),
    )
