"""Take a peg that lies on the table and push it into a lying hole."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Insert, Pick, Release
from bt_tasksim.scene import FixtureSpec, Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence

LEAST, MOST = (0.11, 0.030, 0.030), (0.14, 0.033, 0.033)


def scene(robot: str = "panda") -> Scene:
    """A peg that lies on the table, and a block with a hole in its front or in a side, 3 to 6 mm wider."""
    block = FixtureSpec(
        "socket", area=(0.03, 0.03), yaw=(-0.3, 0.3), parameters={"facing": ("front", "left", "right")}
    )
    peg = ObjectSpec(kinds=("box",), on="table", centre=(0.0, -0.16), area=(0.06, 0.06), size=(LEAST, MOST))
    goal = Goal("peg", "hole", relation="inserted", position_tolerance=0.01)
    return Scene(robot, fixtures=[block], objects={"peg": peg}, goal=goal, name="insert_sideways")


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "insert sideways",
        Grasp("peg"),
        Pick("peg", distance=0.10),
        Insert("peg", into="hole"),
        Release("peg"),
    )
