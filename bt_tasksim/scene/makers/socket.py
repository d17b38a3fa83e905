"""A block with a hole."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.registry import register
from bt_tasksim.core.typed_file import Number
from bt_tasksim.scene.carpentry import DARK, LIGHT, Vector, board, frame, placed
from bt_tasksim.scene.fixture_maker import FixtureMaker, usually
from bt_tasksim.scene.fixtures import Fixture, FixturePlace

STOP = 0.02
"""Thickness of what is behind the hole's end, metres."""
GRIP = 0.4
"""Friction of its walls."""
OUTWARD: dict[str, Vector] = {
    "up": (0.0, 0.0, 1.0),
    "front": (-1.0, 0.0, 0.0),
    "left": (0.0, 1.0, 0.0),
    "right": (0.0, -1.0, 0.0),
}
CLEAR = 0.15
"""Metres before the mouth at which a hand is clear of it."""


@register("fixture", "socket")
class Socket(FixtureMaker):
    """A block with a `hole` for a peg: from above, or lying, in its front or in one of its sides."""

    x: Annotated[Number, usually(0.48, 0.52, ge=-5.0, le=5.0)]
    """Where its middle is, robot base frame, m."""
    y: Annotated[Number, usually(0.12, 0.18, ge=-5.0, le=5.0)]
    """Likewise, m."""
    facing: Annotated[Literal["up", "front", "left", "right"], usually("up")]
    """Where the hole opens: `up`, to the `front`, which is towards the robot, or to a side as it sees it."""
    width: Annotated[Number, usually(0.036, ge=0.004, le=0.3)]
    """Of the hole, from side to side, m."""
    across: Annotated[Number, usually(0.0, ge=0.0, le=0.3)]
    """The other way, m; 0 for as much as it is wide."""
    depth: Annotated[Number, usually(0.05, ge=0.005, le=0.3)]
    """How deep it is, m."""
    wall: Annotated[Number, usually(0.025, ge=0.005, le=0.2)]
    """Thickness of the walls around it, m."""
    height: Annotated[Number, usually(0.08, 0.12, ge=0.01, le=1.0)]
    """Of the middle of a hole that lies above the table, m."""

    def make(self, name: str) -> Fixture:
        """See `FixtureMaker.make`."""
        out, across = np.array(OUTWARD[self.facing]), self.across or self.width
        half = across / 2 + self.wall
        if self.facing == "up":
            at = frame((0.0, 0.0, STOP), (0, 0, 1), (1, 0, 0))
        else:
            side = np.cross([0.0, 0.0, 1.0], out)
            end = np.array([0.0, 0.0, max(self.height, half)]) - out * (self.depth - STOP) / 2
            at = poses.pose(end, poses.from_matrix(np.stack([side, [0.0, 0.0, 1.0], out], axis=1)))
        wide, middle = self.width + 2 * self.wall, self.depth / 2
        local = [board((0.0, 0.0, -STOP / 2), (wide, 2 * half, STOP), DARK)]
        for sign in (-1.0, 1.0):
            aside, over = sign * (self.width + self.wall) / 2, sign * (across + self.wall) / 2
            local.append(board((aside, 0.0, middle), (self.wall, 2 * half, self.depth), LIGHT))
            local.append(board((0.0, over, middle), (self.width, self.wall, self.depth), LIGHT))
        boxes = [placed(at, box) for box in local]
        below = float(at[2]) - half
        if self.facing != "up" and below > 1e-3:
            long, deep = (wide, self.depth + STOP)[:: 1 if out[1] else -1]
            boxes.append(board((0.0, 0.0, below / 2), (long, deep, below), DARK))
        hole = FixturePlace(
            name="hole",
            kind="hole",
            position=(float(at[0]), float(at[1]), float(at[2])),
            turn=tuple(float(v) for v in at[3:]),
            extent=(self.width, across),
            centre=(0.0, 0.0),
            height=self.depth,
            access=(0.0, 0.0, -1.0),
            exit=OUTWARD[self.facing],
            clearance=CLEAR,
        )
        gripping = tuple(replace(box, friction=GRIP) for box in boxes)
        return Fixture(name, self.pose(), gripping, (hole,))
