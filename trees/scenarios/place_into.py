"""Put a thing into a tray, anywhere in it."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Release
from bt_tasksim.scene import FixtureSpec, Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence


def scene(robot: str = "panda") -> Scene:
    """A thing of one of four shapes, and a low tray somewhere on the other side."""
    tray = FixtureSpec("tray", at=(0.48, 0.24), area=(0.04, 0.04), yaw=(-0.4, 0.4))
    target = ObjectSpec(
        kinds=("box", "cylinder", "oval", "diamond"), on="table", centre=(0.0, -0.16), area=(0.08, 0.08)
    )
    return Scene(
        robot,
        fixtures=[tray],
        objects={"target": target},
        goal=Goal("target", inside="tray"),
        name="place_into",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "put it into the tray",
        Grasp("target"),
        Pick("target", distance=0.1),
        Bring("target", to="tray", anywhere=True),
        Place("target", on="tray", anywhere=True),
        Release("target"),
    )
