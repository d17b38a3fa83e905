"""Take a cup from the table and let it fall into a bin."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Release
from bt_tasksim.scene import Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A cup on the table, and a bin beside it."""
    return Scene(
        robot,
        fixtures=["trash_bin"],
        objects={"cup": ObjectSpec(kinds=("cup",), on="table", centre=(0.0, 0.05), mass=(0.05, 0.15))},
        goal=Goal("cup", "trash_bin", relation="inside"),
        name="pick_and_throw",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "pick and throw",
        Grasp("cup"),
        Pick("cup", distance=0.25),
        Bring("cup", to="trash_bin"),
        Release("cup", into="trash_bin", retreat=0.03),
    )
