"""Tip a block that lies on the table up onto its end."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Release, TipUp
from bt_tasksim.scene import Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence

LEAST, MOST = (0.17, 0.036, 0.034), (0.22, 0.052, 0.05)


def scene(robot: str = "panda") -> Scene:
    """A long block that lies on the table, any way round."""
    block = ObjectSpec(kinds=("box",), on="table", area=(0.08, 0.12), size=(LEAST, MOST), mass=(0.1, 0.3))
    return Scene(robot, objects={"block": block}, goal=Goal("block", relation="on_end"), name="tip_up")


def build() -> Behaviour:
    """The tree."""
    return sequence("tip up", Grasp("block"), TipUp("block"), Release("block"))
