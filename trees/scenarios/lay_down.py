"""Lay a thing that stands on the table down on its side."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, LayDown, Release
from bt_tasksim.scene import Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence

LEAST, MOST = (0.042, 0.036, 0.15), (0.06, 0.056, 0.2)


def scene(robot: str = "panda") -> Scene:
    """A tall box or cylinder on the table."""
    tall = ObjectSpec(
        kinds=("box", "cylinder"), on="table", area=(0.08, 0.12), size=(LEAST, MOST), mass=(0.1, 0.3)
    )
    return Scene(robot, objects={"tall": tall}, goal=Goal("tall", relation="lying"), name="lay_down")


def build() -> Behaviour:
    """The tree."""
    return sequence("lay down", Grasp("tall"), LayDown("tall"), Release("tall"))
