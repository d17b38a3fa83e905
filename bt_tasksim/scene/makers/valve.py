"""A valve on a console."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.registry import register
from bt_tasksim.core.typed_file import Number
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.carpentry import RED, STEEL, board, disc, held, placed
from bt_tasksim.scene.control_maker import ControlMaker
from bt_tasksim.scene.fixture_maker import usually
from bt_tasksim.scene.fixtures import Fixture, FixturePart
from bt_tasksim.scene.grips import GivenGrip

STEM, RIM = 0.05, 0.016
"""Height of the wheel's middle above the face, and how thick its rim and spokes are, metres."""
SIDES, SPOKES = 12, 4
"""Straight pieces of the rim, and spokes."""


@register("fixture", "valve")
class Valve(ControlMaker):
    """A `valve` with a wheel or a cross to hold it by; it turns to the left as one looks at it."""

    wheel: Annotated[Literal["wheel", "cross"], usually("wheel", "cross")]
    """Whether its four spokes end in a rim, a `wheel`, or are free, a `cross`."""
    radius: Annotated[Number, usually(0.055, 0.075, ge=0.03, le=0.3)]
    """To the middle of the rim, or where a spoke is held, m."""
    ahead: Annotated[Number, usually(-0.3, 0.3, ge=-3.2, le=3.2)]
    """Where a spoke points at 0, from straight away from the robot, or upwards on a front, rad."""
    turns: Annotated[Number, usually(1.6, 2.6, ge=0.2, le=6.0)]
    """How far it can be turned, rad."""
    value: Annotated[Number, usually(0.0, ge=0.0, le=6.0)]
    """How far it is turned at the start, rad."""
    mass: Annotated[Number, usually(0.3, 0.5, ge=0.02, le=20.0)]
    """Of the wheel, kg."""
    friction: Annotated[Number, usually(0.15, 0.45, ge=0.0, le=20.0)]
    """What it takes to turn it, Nm."""
    damping: Annotated[Number, usually(0.02, 0.06, ge=0.0, le=20.0)]
    """Nm for each rad a second."""

    def make(self, name: str) -> Fixture:
        """See `FixtureMaker.make`."""
        base = self.console()
        mount = poses.multiply(base.mount, poses.pose(np.zeros(3), poses.yaw(self.ahead)))
        local, grasps = self._cross(mount) if self.wheel == "cross" else self._wheel(mount)
        local += disc(0.012, STEM, STEM / 2, STEEL, "metal")
        x, y, z = (float(v) for v in mount[:3])
        out = poses.rotate(mount[3:], np.array([0.0, 0.0, 1.0])).tolist()
        part = FixturePart(
            name="valve",
            boxes=tuple(placed(mount, box) for box in local),
            kind="hinge",
            axis=(out[0], out[1], out[2]),
            origin=(x, y, z),
            limits=(0.0, self.turns),
            mass=self.mass,
            friction=self.friction,
            damping=self.damping,
            value=(self.value, self.value),
            grasps=tuple(grasps),
        )
        return Fixture(name, self.pose(), base.boxes, (), (part,))

    def _cross(self, mount: np.ndarray) -> tuple[list[Box], list[GivenGrip]]:
        """Two bars; either end of each is held by its sides, so that the hand does not slip."""
        long = 2 * (self.radius + 0.015)
        bars = [board((0.0, 0.0, STEM), size, RED) for size in ((long, RIM, RIM), (RIM, long, RIM))]
        grasps = []
        for angle in _angles(SPOKES):
            x, y = math.cos(angle), math.sin(angle)
            at = (self.radius * x, self.radius * y, STEM)
            grasps.append(held(mount, at, (-y, x, 0.0), RIM, (0.0, 0.0, -1.0)))
        return bars, grasps

    def _wheel(self, mount: np.ndarray) -> tuple[list[Box], list[GivenGrip]]:
        """A rim of straight pieces on spokes; it is held across the rim, between two spokes."""
        across = 2 * self.radius
        boxes = [
            board((0.0, 0.0, STEM), size, RED) for size in ((across, 0.012, 0.010), (0.012, across, 0.010))
        ]
        side = 2 * (self.radius + RIM / 2) * math.tan(math.pi / SIDES)
        grasps = []
        for angle in _angles(SIDES):
            at = (self.radius * math.cos(angle), self.radius * math.sin(angle), STEM)
            boxes.append(Box((*at, *poses.yaw(angle).tolist()), (RIM, side, RIM), RED))
        for angle in (a + math.pi / SPOKES for a in _angles(SPOKES)):
            x, y = math.cos(angle), math.sin(angle)
            at = (self.radius * x, self.radius * y, STEM)
            grasps.append(held(mount, at, (x, y, 0.0), RIM, (0.0, 0.0, -1.0)))
        return boxes, grasps


def _angles(n: int) -> list[float]:
    return [2.0 * math.pi * k / n for k in range(n)]
