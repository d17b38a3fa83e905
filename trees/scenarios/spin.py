"""Turn a thing on the table, where it stands, to a heading that is marked there."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Release, Spin
from bt_tasksim.scene import Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A box or an oval on a spot that is turned otherwise."""
    thing = ObjectSpec(kinds=("box", "oval"), on="table", area=(0.0, 0.0))
    return Scene(
        robot,
        objects={"thing": thing},
        spots=[SpotSpec("mark", on="table", yaw=1.5)],
        goal=Goal("thing", "mark"),
        name="spin",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence("spin", Grasp("thing"), Spin("thing", like="mark"), Release("thing"))
