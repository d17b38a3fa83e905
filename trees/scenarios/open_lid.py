"""Lift the lid of a box, and let it go where it stays open."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, OpenLid, Release
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A box whose lid is shut; sizes, place, handle and friction are drawn."""
    return Scene(
        robot,
        fixtures=[
            FixtureSpec(
                "lidded_box",
                parameters={"x": (0.40, 0.44), "length": (0.16, 0.19), "opens": 1.95, "heading": (-0.2, 0.2)},
            )
        ],
        goal=Goal("lid", relation="open", value=1.6),
        name="open_lid",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "open the lid",
        Grasp("lid"),
        OpenLid("lid", angle=1.85),
        Release("lid"),
    )
