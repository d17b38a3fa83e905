"""Grasp an object of unknown shape, size, mass and friction, and lift it: the tree a grasp is trained in.

The scene itself draws objects of every name, with sizes and exponents from the odd strips of their ranges.
Its stages draw superellipsoids from the even strips alone, on the table, and on a stand to which the hand
comes slanted, as to a shelf. Some superellipsoids are nearly boxes, cylinders and ovals, and the strips are
those of each kind's own ranges: 42 to 45 % of the scene's draws lie inside its stages' on each axis.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Pick
from bt_tasksim.scene import CurriculumStage, Goal, HandStart, ObjectSpec, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.nodes.train import Train

LIFT = 0.3
UNSEEN = ObjectSpec(
    kinds=("box", "cup", "cylinder", "oval", "diamond", "superellipsoid"),
    on="table",
    mass=(0.05, 0.6),
    friction=(0.3, 0.9),
    exponents=((0.05, 0.8), (0.05, 2.0)),
    split="odd",
    size_error=0.1,
)
"""Exponents beyond 0.8 in the vertical make bodies that do not stand on a table."""
BOXES = ObjectSpec(
    kinds=("superellipsoid",),
    on="table",
    size=((0.055, 0.04, 0.06), (0.08, 0.055, 0.09)),
    mass=(0.05, 0.3),
    friction=(0.5, 0.9),
    exponents=((0.05, 0.2), (0.05, 0.5)),
    split="even",
    size_error=0.1,
)
SHAPES = ObjectSpec(
    kinds=("superellipsoid",),
    on="table",
    size=((0.045, 0.036, 0.05), (0.09, 0.071, 0.125)),
    mass=(0.05, 0.6),
    friction=(0.3, 0.9),
    exponents=((0.05, 0.8), (0.05, 2.0)),
    split="even",
    size_error=0.1,
)
HAND = HandStart("target")
"""Half a second away: the way from the rest posture is not what is learned."""
TILT = (0.2, 1.05)
"""Radians from straight down; a shelf takes 0.96."""
NOISE = ("original", "hard")


BROAD = ("xarm7_ability",)
"""Robots whose hand is too broad for the stand: its fingers meet the stand, or what is on it, too early.
Of 39 such draws halfway through a training none succeeded."""


def _stage(
    name: str,
    spec: ObjectSpec,
    noise: tuple[str, ...],
    slanted: bool,
    tolerance: float = 1.0,
    until: float = 0.9,
) -> CurriculumStage:
    """On the table alone; or one world of three on the stand, to which the hand comes slanted."""
    table = Scene(objects={"target": spec})
    raised = dataclasses.replace(spec, on="stand", area=(0.02, 0.04))
    stand = Scene(fixtures=["stand"], objects={"target": raised})
    return CurriculumStage(
        name,
        noise=noise,
        hand=HAND,
        tilt=TILT if slanted else None,
        scenes=(table, table, stand) if slanted else (table,),
        tolerance=tolerance,
        until=until,
    )


def stages(slanted: bool = True, **changes: Any) -> tuple[CurriculumStage, ...]:
    """The curriculum.

    Args:
        slanted: In one world of three the hand comes slanted.
        changes: Fields of `ObjectSpec` that are other than here, such as ``mass``.
    """
    boxes, shapes = (dataclasses.replace(spec, **changes) for spec in (BOXES, SHAPES))
    return (
        _stage("near-boxes", boxes, ("fine", "original"), slanted, tolerance=3.0, until=0.6),
        _stage("all shapes", shapes, NOISE, slanted, tolerance=3.0, until=0.65),
        _stage("all shapes, held firmly", shapes, NOISE, slanted),
    )


def scene(robot: str = "panda") -> Scene:
    """One object on the table."""
    return Scene(
        robot,
        objects={"target": UNSEEN},
        goal=Goal("target", "table", relation="lifted", height=LIFT),
        stages=stages(slanted=robot not in BROAD),
        name="grasp_then_pick",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "grasp then pick",
        Train(Grasp("target", timeout=10.0)),
        Pick("target", distance=LIFT, speed=0.5),
    )
