"""The tree that Push is trained in, and its scene: ``bt-tasksim train train_push.py``."""

from __future__ import annotations

from bt_tasksim import HandStart, Lesson, ObjectSpec, Scene, Train
from py_trees.behaviour import Behaviour
from trees import sequence

from push import Push

BLOCK = ObjectSpec(
    kinds=("box",),
    on="table",
    centre=(-0.05, 0.0),
    area=(0.03, 0.08),
    yaw=0.2,
    size=((0.05, 0.05, 0.05), (0.08, 0.08, 0.08)),
    mass=(0.1, 0.4),
    friction=(0.2, 0.9),
    size_error=0.1,
)
"""What is drawn anew for each episode; nothing of it is known exactly."""
HAND = HandStart("block", height=(0.10, 0.14), aside=0.03, turn=0.2)
"""The hand is near at first: the way there is not what is learned."""
NOISE = ("fine", "hard")
"""The estimate of the object's pose is off by some millimetres."""


def scene(robot: str = "panda") -> Scene:
    """A block on the table; first it need not lie so exactly."""
    lessons = (
        Lesson("roughly", noise=NOISE, hand=HAND, tolerance=2.0, until=0.7),
        Lesson("exactly", noise=NOISE, hand=HAND),
    )
    return Scene(robot, objects={"block": BLOCK}, lessons=lessons, name="push")


def build() -> Behaviour:
    """The tree. What follows a Train node judges it; nothing does here, so its own sufficient_cost does."""
    return sequence("push", Train(Push("block")))
