"""Push aside what stands where something is to go, and put that there."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Push, Release
from bt_tasksim.scene import Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import recovering, sequence


def scene(robot: str = "panda") -> Scene:
    """A box on the spot where a cup is to stand, and a spot beside it for the box."""
    return Scene(
        robot,
        objects={
            "box": ObjectSpec(
                kinds=("box", "cube", "can"),
                on="goal",
                area=(0.01, 0.01),
                friction=(0.3, 0.8),
            ),
            "cup": ObjectSpec(kinds=("cup", "cylinder"), on="table", centre=(0.0, -0.28), area=(0.06, 0.04)),
        },
        spots=[
            SpotSpec("goal", on="table", centre=(0.0, 0.02), area=(0.04, 0.03)),
            SpotSpec("aside", on="table", centre=(0.0, 0.26), area=(0.04, 0.03), extent=(0.06, 0.06)),
        ],
        goals=[Goal("box", "aside", relation="anywhere"), Goal("cup", "goal")],
        name="make_room",
    )


def build() -> Behaviour:
    """The tree; what goes wrong is put right."""
    return recovering(
        sequence(
            "make room",
            Push("box", to="aside"),
            Grasp("cup"),
            Pick("cup", distance=0.10),
            Bring("cup", to="goal"),
            Place("cup", on="goal"),
            Release("cup"),
        )
    )
