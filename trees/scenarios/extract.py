"""Pull a peg out of its hole and put it down on the table."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Extract, Grasp, Place, Release
from bt_tasksim.scene import FixtureSpec, Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A peg in the hole of a block, with 1.5 to 3 mm of room around it, and a spot for it."""
    return Scene(
        robot,
        fixtures=[FixtureSpec("peg_block", area=(0.04, 0.04), yaw=(-0.4, 0.4))],
        objects={"peg": ObjectSpec(kinds=("peg",), on="hole", area=(0.001, 0.001), yaw=(-0.02, 0.02))},
        spots=[SpotSpec("spot", on="table", centre=(0.0, -0.16), area=(0.06, 0.06), yaw=0.5)],
        goal=Goal("peg", "spot"),
        name="extract",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "extract",
        Grasp("peg"),
        Extract("peg", out_of="hole"),
        Bring("peg", to="spot"),
        Place("peg", on="spot"),
        Release("peg"),
    )
