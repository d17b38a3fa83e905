"""Grasp a heavy, slippery object and lift it fast: what follows a grasp says how firm it should be.

Shapes, stages and strips are those of `grasp_then_pick`; `grasp_gentle_lift` is the opposite.
"""

from __future__ import annotations

from dataclasses import replace

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Pick
from bt_tasksim.scene import Goal, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.nodes.train import Train
from bt_tasksim.trees.scenarios.grasp_gentle_lift import TIGHTENING, TIMEOUT
from bt_tasksim.trees.scenarios.grasp_then_pick import UNSEEN, stages

MASS, FRICTION = (0.4, 0.9), (0.1, 0.3)
LIFT, SPEED = 0.3, 1.2
"""Metres and metres per second: 0.9 kg pull with up to 16 N."""


def scene(robot: str = "panda") -> Scene:
    """One heavy object on the table."""
    return Scene(
        robot,
        objects={"target": replace(UNSEEN, mass=MASS, friction=FRICTION)},
        goal=Goal("target", "table", relation="lifted", height=LIFT),
        stages=stages(mass=MASS, friction=FRICTION),
        name="grasp_fast_heavy",
    )


def build(grip: float = 1.0) -> Behaviour:
    """The tree, with a grasp that closes to ``grip``."""
    return sequence(
        "grasp, fast heavy lift",
        Train(Grasp("target", grip=grip, tightening=TIGHTENING, timeout=TIMEOUT)),
        Pick("target", distance=LIFT, speed=SPEED),
    )
