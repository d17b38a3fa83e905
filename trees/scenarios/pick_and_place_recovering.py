"""As pick_and_place with a cube, which is knocked out of the hand on the way and has to be brought back."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import AtPose, Bring, Grasp, Holding, Pick, Place, Release, Wait
from bt_tasksim.scene import Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import fallback, retry, sequence

ATTEMPTS = 4


def scene(robot: str = "panda") -> Scene:
    """A cube on the table, a spot for it, and a blow at a random moment."""
    return Scene(
        robot,
        objects={"cube": ObjectSpec(kinds=("cube",), on="table", centre=(0.0, -0.10), area=(0.06, 0.08))},
        spots=[SpotSpec("goal", on="table", centre=(0.0, 0.14), area=(0.06, 0.06), yaw=0.5)],
        goal=Goal("cube", "goal"),
        disturbed="cube",
        name="pick_and_place_recovering",
    )


def build() -> Behaviour:
    """The tree: whatever happens to the cube, it is taken again, a bounded number of times."""
    return fallback(
        "cube is in place",
        AtPose("cube", on="goal"),
        retry(
            ATTEMPTS,
            sequence(
                "bring it there",
                fallback(
                    "cube in hand",
                    Holding("cube"),
                    sequence("take it", Wait(0.6, name="let it come to rest"), Grasp("cube"), Pick("cube")),
                ),
                Bring("cube", to="goal"),
                Place("cube", on="goal"),
                Release("cube"),
                AtPose("cube", on="goal"),
            ),
        ),
    )
