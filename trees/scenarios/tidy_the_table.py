"""Tidy a table: a can into the bin, a cup onto its coaster, a box into the tray."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Release
from bt_tasksim.scene import FixtureSpec, Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import recovering, sequence


def scene(robot: str = "panda") -> Scene:
    """Three things in the middle of the table, and where each belongs."""
    return Scene(
        robot,
        fixtures=[
            FixtureSpec("trash_bin", at=(0.42, -0.42)),
            FixtureSpec("tray", at=(0.44, 0.38), area=(0.02, 0.02), yaw=(-0.2, 0.2)),
        ],
        objects={
            "can": ObjectSpec(kinds=("can",), on="table", centre=(0.02, -0.10), area=(0.06, 0.04), gap=0.03),
            "cup": ObjectSpec(kinds=("cup",), on="table", centre=(0.02, 0.02), area=(0.06, 0.04), gap=0.03),
            "box": ObjectSpec(
                kinds=("box", "cube"), on="table", centre=(0.02, 0.14), area=(0.06, 0.04), gap=0.03
            ),
        },
        spots=[SpotSpec("coaster", on="table", centre=(0.18, 0.0), area=(0.02, 0.06))],
        goals=[Goal("can", inside="trash_bin"), Goal("cup", "coaster"), Goal("box", inside="tray")],
        name="tidy_the_table",
    )


def build() -> Behaviour:
    """The tree: fourteen tasks; what goes wrong is put right."""
    return recovering(
        sequence(
            "tidy the table",
            Grasp("can"),
            Pick("can"),
            Bring("can", to="trash_bin"),
            Release("can", into="trash_bin"),
            Grasp("cup"),
            Pick("cup"),
            Bring("cup", to="coaster"),
            Place("cup", on="coaster"),
            Release("cup"),
            Grasp("box"),
            Pick("box"),
            Bring("box", to="tray", anywhere=True),
            Place("box", on="tray", anywhere=True),
            Release("box"),
        )
    )
