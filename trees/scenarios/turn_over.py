"""Lift what stands on the table, and turn it upside down in the air."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Pick, Turn
from bt_tasksim.scene import Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence

LEAST, MOST = (0.045, 0.045, 0.08), (0.065, 0.065, 0.13)
DOWN = (0.0, 0.0, -1.0)


def scene(robot: str = "panda") -> Scene:
    """A cup or a box that stands on the table, any way round."""
    thing = ObjectSpec(
        kinds=("cup", "box", "cylinder"), on="table", area=(0.08, 0.12), size=(LEAST, MOST), mass=(0.08, 0.2)
    )
    goal = Goal("thing", relation="pointing_up", axis=DOWN)
    return Scene(robot, objects={"thing": thing}, goal=goal, name="turn_over")


def build() -> Behaviour:
    """The tree."""
    return sequence("turn over", Grasp("thing"), Pick("thing", distance=0.15), Turn("thing", up=DOWN))
