"""Take a cup from a shelf's upper board to its lower one."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Release
from bt_tasksim.scene import Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A shelf with a cup on the upper board."""
    return Scene(
        robot,
        fixtures=["shelf"],
        objects={"cup": ObjectSpec(kinds=("cup",), on="upper_board", mass=(0.08, 0.2))},
        goal=Goal("cup", "lower_board"),
        name="shelf_to_shelf",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "shelf to shelf",
        Grasp("cup"),
        Pick("cup", distance=0.08),
        Bring("cup", to="lower_board"),
        Place("cup", on="lower_board"),
        Release("cup"),
    )
