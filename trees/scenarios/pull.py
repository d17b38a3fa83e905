"""Pull an object that stands far away to a marked spot nearer to the robot."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Pull
from bt_tasksim.scene import Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import retry


def scene(robot: str = "panda") -> Scene:
    """An object of one of five shapes, and a spot for it."""
    return Scene(
        robot,
        objects={
            "target": ObjectSpec(
                kinds=("box", "cube", "cylinder", "can", "diamond"),
                on="table",
                centre=(0.09, 0.05),
                area=(0.05, 0.14),
                friction=(0.3, 0.8),
            )
        },
        spots=[SpotSpec("goal", on="table", centre=(-0.11, 0.0), area=(0.04, 0.16), extent=(0.06, 0.06))],
        goal=Goal("target", "goal", relation="anywhere"),
        name="pull",
    )


def build() -> Behaviour:
    """The tree: what has turned away aside is pulled anew from where it is."""
    return retry(3, Pull("target", to="goal"), name="pull near")
