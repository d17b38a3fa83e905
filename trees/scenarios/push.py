"""Push an object over the table onto a marked spot; the hand comes in between it and a cup."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Push
from bt_tasksim.scene import Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import retry


def scene(robot: str = "panda") -> Scene:
    """An object of one of five shapes, a spot for it, and a cup on the object's other side."""
    return Scene(
        robot,
        objects={
            "target": ObjectSpec(
                kinds=("box", "cube", "cylinder", "can", "diamond"),
                on="table",
                centre=(0.0, -0.14),
                area=(0.08, 0.08),
                friction=(0.3, 0.8),
            ),
            "cup": ObjectSpec(kinds=("cup",), on="table", centre=(0.0, -0.37), area=(0.10, 0.02)),
        },
        spots=[SpotSpec("goal", on="table", centre=(0.02, 0.14), area=(0.08, 0.08), extent=(0.06, 0.06))],
        goal=Goal("target", "goal", relation="anywhere"),
        name="push",
    )


def build() -> Behaviour:
    """The tree: what has turned away aside is pushed anew from where it is."""
    return retry(3, Push("target", to="goal"), name="push over")
