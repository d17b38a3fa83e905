"""Take an object from the table and put it on a spot beside it."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Release
from bt_tasksim.scene import Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """An object of one of four shapes on the table, and a spot for it."""
    return Scene(
        robot,
        objects={
            "target": ObjectSpec(
                kinds=("box", "cylinder", "oval", "diamond"),
                on="table",
                centre=(0.0, -0.14),
                area=(0.08, 0.10),
            )
        },
        spots=[SpotSpec("goal", on="table", centre=(0.0, 0.16), area=(0.08, 0.08), yaw=0.5)],
        goal=Goal("target", "goal"),
        name="pick_and_place",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "pick and place",
        Grasp("target"),
        Pick("target", distance=0.08),
        Bring("target", to="goal"),
        Place("target", on="goal"),
        Release("target"),
    )
