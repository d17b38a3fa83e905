"""Take a book from the table and put it into a gap in a row of books."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Insert, Pick, Release
from bt_tasksim.scene import FixtureSpec, Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A book that stands on the table, and a row with a gap 4 to 8 mm wider than it is thick."""
    return Scene(
        robot,
        fixtures=[FixtureSpec("book_row", area=(0.03, 0.03), yaw=(-0.3, 0.3))],
        objects={
            "book": ObjectSpec(
                kinds=("book",), on="table", centre=(0.0, -0.16), area=(0.05, 0.05), yaw=(-0.6, 0.6)
            )
        },
        goal=Goal("book", "gap", relation="inserted", position_tolerance=0.015),
        name="insert_book",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "insert a book",
        Grasp("book"),
        Pick("book", distance=0.12),
        Insert("book", into="gap"),
        Release("book"),
    )
