"""Pull a peg out of a lying hole and put it down on the table."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Extract, Grasp, Place, Release
from bt_tasksim.scene import FixtureSpec, Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A peg in a hole in the front or in a side of a block, 3 to 6 mm wider, and a spot for it."""
    block = FixtureSpec(
        "socket", area=(0.03, 0.03), yaw=(-0.3, 0.3), parameters={"facing": ("front", "left", "right")}
    )
    peg = ObjectSpec(kinds=("peg",), on="hole", area=(0.0005, 0.0005), yaw=(-0.01, 0.01))
    return Scene(
        robot,
        fixtures=[block],
        objects={"peg": peg},
        spots=[SpotSpec("spot", on="table", centre=(0.0, -0.16), area=(0.06, 0.06), yaw=0.5)],
        goal=Goal("peg", "spot"),
        name="extract_sideways",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "extract sideways",
        Grasp("peg"),
        Extract("peg", out_of="hole"),
        Bring("peg", to="spot"),
        Place("peg", on="spot"),
        Release("peg"),
    )
