"""A knob that turns on a console."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.registry import register
from bt_tasksim.core.typed_file import Number
from bt_tasksim.scene.carpentry import (
    STEEL,
    WHITE,
    board,
    disc,
    held,
    placed,
)
from bt_tasksim.scene.control_maker import ControlMaker
from bt_tasksim.scene.fixture_maker import usually
from bt_tasksim.scene.fixtures import Fixture, FixturePart

SKIRT, RIDGE = 0.012, 0.032
"""Height of the round foot, and of the ridge on it to hold it by, metres."""


@register("fixture", "knob")
class Knob(ControlMaker):
    """A `knob` with a ridge to hold it by; it turns to the left as one looks at it."""

    diameter: Annotated[Number, usually(0.048, 0.064, ge=0.02, le=0.15)]
    """Of its foot, and the ridge's length, m."""
    ridge: Annotated[Number, usually(0.016, 0.024, ge=0.006, le=0.07)]
    """Width of the ridge, m."""
    ahead: Annotated[Number, usually(-0.3, 0.3, ge=-3.2, le=3.2)]
    """Where the ridge points at 0, from straight away from the robot, or upwards on a front, rad."""
    turns: Annotated[Number, usually(2.0, 2.6, ge=0.2, le=6.0)]
    """How far it can be turned, rad."""
    value: Annotated[Number, usually(0.0, ge=0.0, le=6.0)]
    """How far it is turned at the start, rad."""
    mass: Annotated[Number, usually(0.1, ge=0.01, le=5.0)]
    """Of the knob, kg."""
    friction: Annotated[Number, usually(0.05, 0.20, ge=0.0, le=5.0)]
    """What it takes to turn it, Nm."""
    damping: Annotated[Number, usually(0.01, 0.03, ge=0.0, le=5.0)]
    """Nm for each rad a second."""
    spring: Annotated[Number, usually(0.0, ge=0.0, le=5.0)]
    """Of the spring that turns it back, Nm/rad."""

    def make(self, name: str) -> Fixture:
        """See `FixtureMaker.make`."""
        base = self.console()
        turned = poses.pose(np.zeros(3), poses.yaw(self.ahead))
        mount = poses.multiply(base.mount, turned)
        z = SKIRT + RIDGE / 2
        local = [
            *disc(self.diameter / 2, SKIRT, SKIRT / 2, STEEL),
            board((0.0, 0.0, z), (self.diameter, self.ridge, RIDGE), STEEL, "metal"),
            board((self.diameter / 4, 0.0, SKIRT + RIDGE), (self.diameter / 2, 0.004, 0.002), WHITE, "matte"),
        ]
        x, y, height = (float(v) for v in mount[:3])
        out = poses.rotate(mount[3:], np.array([0.0, 0.0, 1.0])).tolist()
        part = FixturePart(
            name="knob",
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
            grasps=(held(mount, (0.0, 0.0, z + 0.004), (0.0, 1.0, 0.0), self.ridge, (0.0, 0.0, -1.0)),),
        )
        return Fixture(name, self.pose(), base.boxes, (), (part,))
