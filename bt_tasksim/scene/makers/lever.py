"""A lever on a console."""

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

CLEAR, ARM, PEG, TALL = 0.012, 0.014, 0.020, 0.055
"""The arm's distance from the face, its thickness, and width and height of the peg at its end, metres."""


@register("fixture", "lever")
class Lever(ControlMaker):
    """A `lever` that turns onto a stop, with a peg at its end to hold it by."""

    length: Annotated[Number, usually(0.08, 0.11, ge=0.03, le=0.4)]
    """From the axis to the peg, m."""
    side: Annotated[Literal["left", "right"], usually("left", "right")]
    """Which way it turns, as one looks at it."""
    ahead: Annotated[Number, usually(-0.2, 0.2, ge=-3.2, le=3.2)]
    """Where it points at 0, from straight away from the robot, or upwards on a front, rad."""
    turns: Annotated[Number, usually(1.2, 1.6, ge=0.2, le=3.0)]
    """How far it is from one stop to the other, rad."""
    value: Annotated[Number, usually(0.0, ge=0.0, le=3.0)]
    """How far it is turned at the start, rad."""
    mass: Annotated[Number, usually(0.15, 0.25, ge=0.02, le=10.0)]
    """Of the lever, kg."""
    friction: Annotated[Number, usually(0.3, 0.6, ge=0.0, le=20.0)]
    """What it takes to turn it, Nm; on a front it has to bear its weight."""
    damping: Annotated[Number, usually(0.02, 0.06, ge=0.0, le=20.0)]
    """Nm for each rad a second."""
    spring: Annotated[Number, usually(0.0, ge=0.0, le=50.0)]
    """Of the spring that turns it back, Nm/rad."""

    def make(self, name: str) -> Fixture:
        """See `FixtureMaker.make`."""
        base = self.console()
        turned = poses.pose(np.zeros(3), poses.yaw(self.ahead))
        mount = poses.multiply(base.mount, turned)
        way = 1.0 if self.side == "left" else -1.0
        z = CLEAR + ARM / 2
        local = [
            *disc(0.016, z + ARM / 2, (z + ARM / 2) / 2, STEEL, "metal"),
            board((self.length / 2, 0.0, z), (self.length, ARM, ARM), STEEL, "metal"),
            board((self.length, 0.0, CLEAR + TALL / 2), (PEG, PEG, TALL), RED),
        ]
        out = poses.rotate(mount[3:], np.array([0.0, 0.0, way])).tolist()
        x, y, height = (float(v) for v in mount[:3])
        point = (self.length, 0.0, CLEAR + TALL - 0.018)
        part = FixturePart(
            name="lever",
            boxes=tuple(placed(mount, box) for box in local),
            kind="hinge",
            axis=(out[0], out[1], out[2]),
            origin=(x, y, height),
            limits=(0.0, self.turns),
            mass=self.mass,
            friction=self.friction,
            damping=self.damping,
            stiffness=self.spring,
            value=(self.value, self.value),
            grasps=tuple(
                held(mount, point, closing, PEG, (0.0, 0.0, -1.0))
                for closing in ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
            ),
        )
        stops = [placed(mount, _stop(way * angle)) for angle in (-_AHEAD, self.turns + _AHEAD)]
        return Fixture(name, self.pose(), (*base.boxes, *stops), (), (part,))


_WHERE = 0.045
"""Metres from the axis to a stop."""
_AHEAD = math.atan2(ARM / 2 + 0.006, _WHERE)
"""Radians from the arm's middle to that of the stop that it leans on."""


def _stop(angle: float) -> Box:
    """What the arm leans on, at an angle from x about z."""
    at = (_WHERE * math.cos(angle), _WHERE * math.sin(angle), (CLEAR + ARM) / 2)
    return Box((*at, *poses.yaw(angle).tolist()), (0.012, 0.012, CLEAR + ARM), STEEL, material="metal")
