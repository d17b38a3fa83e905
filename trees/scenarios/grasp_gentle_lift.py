"""Grasp a light, fragile object and lift it slowly: what follows a grasp says how firm it should be.

The follower's own goal limits the hand's force on the object, which no policy can see. Shapes, stages and
strips are those of `grasp_then_pick`; `grasp_fast_heavy` is the opposite.
"""

from __future__ import annotations

from dataclasses import replace

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Pick
from bt_tasksim.scene import Goal, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.nodes.train import Train
from bt_tasksim.trees.scenarios.grasp_then_pick import UNSEEN, stages

MASS, FRICTION = (0.05, 0.15), (0.3, 0.9)
LIFT, SPEED = 0.15, 0.15
SQUEEZE = 12.0
"""N, of both fingers together: a cup of 150 g needs about 3."""
TIGHTENING, TIMEOUT = 0.06, 15.0
"""Each finger of the Panda presses 0.3 N more in each control period, so being done early or late says how
firm the grasp is: the gentle pick wants it within some 10 periods, which exploring meets often enough."""


def scene(robot: str = "panda") -> Scene:
    """One light object on the table."""
    return Scene(
        robot,
        objects={"target": replace(UNSEEN, mass=MASS, friction=FRICTION)},
        goal=Goal("target", "table", relation="lifted", height=LIFT),
        stages=stages(mass=MASS, friction=FRICTION),
        name="grasp_gentle_lift",
    )


def build(grip: float = 1.0) -> Behaviour:
    """The tree, with a grasp that closes to ``grip``."""
    return sequence(
        "grasp, gentle lift",
        Train(Grasp("target", grip=grip, tightening=TIGHTENING, timeout=TIMEOUT)),
        Pick("target", distance=LIFT, speed=SPEED, squeeze=SQUEEZE),
    )
