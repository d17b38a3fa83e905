"""Grasp a heavy, slippery object and lift it fast: what follows a grasp says how firm it should be.

Shapes, lessons and strips are those of `grasp_then_pick`; `grasp_gentle_lift` is the opposite.
"""

from __future__ import annotations

from dataclasses import replace

from py_trees.behaviour import Behaviour

from bt_tasksim.scene import Goal, Scene
from bt_tasksim.training.decorator import Train
from concept_nodes import Grasp, Pick
from trees.authoring import sequence
from trees.scenarios.grasp_gentle_lift import TIGHTENING, TIMEOUT
from trees.scenarios.grasp_then_pick import UNSEEN, lessons

MASS, FRICTION = (0.4, 0.9), (0.1, 0.3)
LIFT, SPEED = 0.3, 1.2
"""Metres and metres per second: 0.9 kg pull with up to 16 N."""


def scene(robot: str = "panda") -> Scene:
    """One heavy object on the table."""
    return Scene(
        robot,
        objects={"target": replace(UNSEEN, mass=MASS, friction=FRICTION)},
        goal=Goal("target", "table", relation="lifted", height=LIFT),
        lessons=lessons(mass=MASS, friction=FRICTION),
        name="grasp_fast_heavy",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "grasp, fast heavy lift",
        Train(Grasp("target", tightening=TIGHTENING, timeout=TIMEOUT)),
        Pick("target", distance=LIFT, speed=SPEED),
    )
