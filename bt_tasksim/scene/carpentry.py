"""What furniture that is made by numbers consists of: boards, handles, and consoles to mount things on."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.grips import GivenGrip

Colour = tuple[float, float, float]
Vector = tuple[float, float, float]
DARK, LIGHT, PALE = (0.62, 0.44, 0.27), (0.72, 0.53, 0.34), (0.80, 0.66, 0.47)
"""Colours of wood."""
STEEL, GREY, RED, WHITE = (0.30, 0.31, 0.33), (0.55, 0.57, 0.60), (0.75, 0.16, 0.14), (0.92, 0.92, 0.90)

BAR = 0.014
"""Thickness of a bar to pull by, metres."""
STANDOFF = 0.04
"""Metres from a face to the middle of a handle: fingers go behind it."""
KNOB = 0.030
"""Width of a knob to pull by, metres."""

HandleKind = Literal["bar", "knob"]
Facing = Literal["up", "front"]


class Made(NamedTuple):
    """Boxes, and where two fingers may hold them."""

    boxes: tuple[Box, ...]
    grasps: tuple[GivenGrip, ...]


def board(centre: Vector, size: Vector, colour: Colour = LIGHT, material: str = "wood") -> Box:
    """An upright box about a point."""
    return Box((*centre, 1.0, 0.0, 0.0, 0.0), size, colour, material=material)


def frame(at: Vector, outward: Vector, along: Vector) -> Array:
    """Pose ``(7,)`` of a place on a face: z points away from the face, and x along something."""
    z, x = np.array(outward, float), np.array(along, float)
    return poses.pose(np.array(at, float), poses.from_matrix(np.stack([x, np.cross(z, x), z], axis=1)))


def placed(pose: Array, box: Box) -> Box:
    """A box that was given in a frame with this pose."""
    at = poses.multiply(pose, np.array(box.pose, float))
    return Box(_rounded(at), box.size, box.colour, box.friction, box.material)


def held(pose: Array, point: Vector, closing: Vector, width: float, approach: Vector | None) -> GivenGrip:
    """A grasp that was given in a frame with this pose."""
    return GivenGrip(
        point=_three(poses.transform(pose, np.array(point, float))),
        closing=_three(poses.rotate(pose[3:], np.array(closing, float))),
        width=width,
        approach=None if approach is None else _three(poses.rotate(pose[3:], np.array(approach, float))),
    )


def handle(kind: HandleKind, at: Array, length: float = 0.13) -> Made:
    """Something to pull by: a bar on two posts along x of a frame on a face, or a knob.

    Args:
        kind: Which.
        at: Pose ``(7,)`` of the frame, see `frame`.
        length: Of a bar, metres.
    """
    into: Vector = (0.0, 0.0, -1.0)
    if kind == "bar":
        posts = [
            board((side * (length / 2 - 0.015), 0.0, STANDOFF / 2), (0.012, 0.012, STANDOFF), STEEL, "metal")
            for side in (-1.0, 1.0)
        ]
        boxes = [*posts, board((0.0, 0.0, STANDOFF), (length, BAR, BAR), STEEL, "metal")]
        grasps = [held(at, (0.0, 0.0, STANDOFF), (0.0, 1.0, 0.0), BAR, into)]
    else:
        boxes = [
            board((0.0, 0.0, 0.0125), (0.014, 0.014, 0.025), STEEL, "metal"),
            board((0.0, 0.0, STANDOFF - 0.003), (KNOB, KNOB, 0.024), STEEL, "metal"),
        ]
        middle: Vector = (0.0, 0.0, STANDOFF - 0.003)
        grasps = [held(at, middle, closing, KNOB, into) for closing in ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))]
    return Made(tuple(placed(at, box) for box in boxes), tuple(grasps))


def disc(radius: float, height: float, z: float, colour: Colour, material: str = "matte") -> list[Box]:
    """Boxes that together are about round: an octagon about z.

    Args:
        radius: Of the circle within, metres.
        height: Along z, metres.
        z: Where its middle is.
        colour: Its colour.
        material: What it is drawn like.
    """
    side = 2.0 * radius * math.tan(math.pi / 8.0)
    return [
        Box(
            (0.0, 0.0, z, *poses.yaw(k * math.pi / 4).tolist()),
            (2 * radius, side, height),
            colour,
            0.6,
            material,
        )
        for k in range(4)
    ]


class Console(NamedTuple):
    """Something to mount controls on: its boxes, and the frame of the place for them, see `frame`."""

    boxes: tuple[Box, ...]
    mount: Array


def console(facing: Facing, height: float, size: float = 0.20) -> Console:
    """A block on the table whose top carries the control, or an upright one whose front does.

    Args:
        facing: Where the control looks: ``up``, or to the ``front``, which is towards the robot.
        height: Of the control's middle above the table, metres.
        size: Width of the face, metres.
    """
    if facing == "up":
        block = board((0.0, 0.0, height / 2), (size, size, height), GREY, "matte")
        return Console((block,), frame((0.0, 0.0, height), (0, 0, 1), (1, 0, 0)))
    top = height + size / 2
    block = board((0.06, 0.0, top / 2), (0.12, size, top), GREY, "matte")
    return Console((block,), frame((0.0, 0.0, height), (-1, 0, 0), (0, 0, 1)))


def _three(vector: Array) -> Vector:
    x, y, z = (round(float(v), 9) + 0.0 for v in vector)
    return x, y, z


def _rounded(pose: Array) -> tuple[float, ...]:
    return (*_three(pose[:3]), *(float(v) for v in pose[3:]))
