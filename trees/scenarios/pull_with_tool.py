"""Take a block and pull an object nearer with it, onto a marked spot; then put the block down."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Pick, Place, Pull, Release
from bt_tasksim.scene import Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import retry, sequence


def scene(robot: str = "panda") -> Scene:
    """An object of one of four shapes, a spot for it, and an upright block."""
    return Scene(
        robot,
        objects={
            "target": ObjectSpec(
                kinds=("box", "cube", "cylinder", "can"),
                on="table",
                centre=(0.08, 0.06),
                area=(0.04, 0.10),
                friction=(0.3, 0.8),
            ),
            "block": ObjectSpec(
                kinds=("box",),
                on="table",
                centre=(-0.08, -0.30),
                area=(0.03, 0.03),
                yaw=0.5,
                size=((0.055, 0.028, 0.10), (0.075, 0.036, 0.13)),
                friction=(0.6, 0.9),
                movable=True,
            ),
        },
        spots=[SpotSpec("goal", on="table", centre=(-0.11, 0.06), area=(0.03, 0.10), extent=(0.06, 0.06))],
        goal=Goal("target", "goal", relation="anywhere"),
        name="pull_with_tool",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "pull with the block",
        Grasp("block"),
        Pick("block", distance=0.06),
        retry(3, Pull("target", to="goal", tool="block"), name="pull near"),
        Place("block", anywhere=True),
        Release("block"),
    )
