"""Grasp an object of unknown shape, size, mass and friction, and lift it: the tree a grasp is trained in."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.scene import Goal, ObjectSpec, Scene
from concept_nodes import Grasp, Pick
from trees.authoring import sequence

LIFT = 0.3


def scene(robot: str = "panda") -> Scene:
    """One object on the table: the held-apart draws."""
    return Scene(
        robot,
        objects={
            "target": ObjectSpec(
                kinds=("box", "cup", "cylinder", "oval", "diamond", "superellipsoid"),
                on="table",
                mass=(0.05, 0.6),
                friction=(0.3, 0.9),
                exponents=((0.05, 0.8), (0.05, 2.0)),
                strips="odd",
                size_error=0.1,
            )
        },
        goal=Goal("target", "table", relation="lifted", height=LIFT),
        name="grasp_then_pick",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence("grasp then pick", Grasp("target"), Pick("target", distance=LIFT))
