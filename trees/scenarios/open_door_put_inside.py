"""Open a cabinet's door, and put a cup from the table into the cabinet."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Grasp, OpenDoor, Pick, Place, Release
from bt_tasksim.scene import FixtureSpec, Goal, ObjectSpec, Scene
from bt_tasksim.trees import recovering, sequence


def scene(robot: str = "panda") -> Scene:
    """A cabinet whose door is shut, beside the middle, and a cup on the table."""
    return Scene(
        robot,
        fixtures=[
            FixtureSpec(
                "door",
                parameters={
                    "x": (0.66, 0.70),
                    "y": (0.08, 0.14),
                    "heading": (0.0, 0.2),
                    "side": "left",
                    "radius": (0.25, 0.28),
                    "height": 0.36,
                },
            )
        ],
        objects={
            "cup": ObjectSpec(
                kinds=("cup",), on="table", centre=(-0.08, -0.30), area=(0.04, 0.04), mass=(0.08, 0.2)
            )
        },
        goals=[Goal("cup", "cabinet", position_tolerance=0.15), Goal("door", relation="open", value=1.2)],
        name="open_door_put_inside",
    )


def build() -> Behaviour:
    """The tree; what goes wrong is put right."""
    return recovering(
        sequence(
            "put the cup into the cabinet",
            Grasp("door"),
            OpenDoor("door", angle=1.4),
            Release("door"),
            Grasp("cup"),
            Pick("cup", distance=0.10),
            Bring("cup", to="cabinet", anywhere=True),
            Place("cup", on="cabinet", anywhere=True),
            Release("cup"),
        )
    )
