"""Take a peg from the table and push it into a hole."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Insert, Pick, Release
from bt_tasksim.scene import FixtureSpec, Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A square peg that stands on the table, and a block with a hole 3 to 6 mm wider."""
    return Scene(
        robot,
        fixtures=[FixtureSpec("peg_block", area=(0.04, 0.04), yaw=(-0.4, 0.4))],
        objects={"peg": ObjectSpec(kinds=("peg",), on="table", centre=(0.0, -0.14), area=(0.06, 0.06))},
        goal=Goal("peg", "hole", relation="inserted", position_tolerance=0.01),
        name="insert",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "insert",
        Grasp("peg"),
        Pick("peg", distance=0.10),
        Insert("peg", into="hole"),
        Release("peg"),
    )
