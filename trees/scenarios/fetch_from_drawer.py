"""Fetch a cube from a drawer: open it, take the cube out, put it on its spot, and shut the drawer again."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, CloseDrawer, Grasp, OpenDrawer, Pick, Place, Release
from bt_tasksim.scene import FixtureSpec, Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import recovering, sequence


def scene(robot: str = "panda") -> Scene:
    """A chest, a cube in its drawer, where an open hand has room about it, and a spot for it on the table."""
    return Scene(
        robot,
        fixtures=[
            FixtureSpec(
                "drawer",
                parameters={
                    "x": (0.68, 0.72),
                    "y": (-0.12, -0.06),
                    "heading": (-0.1, 0.1),
                    "width": (0.30, 0.34),
                    "depth": (0.28, 0.32),
                    "base": 0.10,
                    "opens": 0.25,
                },
            )
        ],
        objects={
            "cube": ObjectSpec(
                kinds=("cube",),
                inside="drawer",
                size=((0.04, 0.04, 0.04), (0.05, 0.05, 0.05)),
                centre=(-0.03, 0.0),
                area=(0.01, 0.03),
            )
        },
        spots=[SpotSpec("spot", on="table", centre=(-0.02, 0.28), area=(0.04, 0.03))],
        goals=[Goal("cube", "spot"), Goal("drawer", relation="shut")],
        name="fetch_from_drawer",
    )


def build() -> Behaviour:
    """The tree; what goes wrong is put right."""
    return recovering(
        sequence(
            "fetch the cube",
            Grasp("drawer"),
            OpenDrawer("drawer", distance=0.23),
            Release("drawer"),
            Grasp("cube"),
            Pick("cube", distance=0.15),
            Bring("cube", to="spot"),
            Place("cube", on="spot"),
            Release("cube"),
            Grasp("drawer", name="take the drawer again"),
            CloseDrawer("drawer"),
            Release("drawer", name="let go of the drawer again"),
        )
    )
