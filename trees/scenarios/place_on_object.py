"""Put a thing on top of another one, wherever that stands."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Release
from bt_tasksim.scene import Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A thing of one of four shapes, and a wide block for it."""
    block = ObjectSpec(
        kinds=("box",),
        on="table",
        centre=(0.0, 0.15),
        area=(0.08, 0.08),
        size=((0.09, 0.09, 0.05), (0.12, 0.12, 0.08)),
        mass=(0.3, 0.6),
    )
    target = ObjectSpec(
        kinds=("box", "cylinder", "oval", "diamond"), on="table", centre=(0.0, -0.14), area=(0.08, 0.10)
    )
    return Scene(
        robot,
        objects={"target": target, "block": block},
        goal=Goal("target", on="block"),
        name="place_on_object",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "put it on the block",
        Grasp("target"),
        Pick("target", distance=0.12),
        Bring("target", to="block"),
        Place("target", on="block"),
        Release("target"),
    )
