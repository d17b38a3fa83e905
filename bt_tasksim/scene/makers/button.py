"""A button on a console."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.registry import register
from bt_tasksim.core.typed_file import Number
from bt_tasksim.scene.carpentry import RED, STEEL, disc, placed
from bt_tasksim.scene.control_maker import ControlMaker
from bt_tasksim.scene.fixture_maker import usually
from bt_tasksim.scene.fixtures import Fixture, FixturePart


@register("fixture", "button")
class Button(ControlMaker):
    """A `button`: at 0 its spring holds it out, and its value grows as it is pressed in."""

    diameter: Annotated[Number, usually(0.04, 0.06, ge=0.015, le=0.2)]
    """m."""
    travel: Annotated[Number, usually(0.006, 0.010, ge=0.002, le=0.05)]
    """How far it can be pressed in, m."""
    stiffness: Annotated[Number, usually(300.0, 600.0, ge=20.0, le=5000.0)]
    """Of its spring, N/m."""
    preload: Annotated[Number, usually(2.0, 4.0, ge=0.6, le=50.0)]
    """What it takes for it to begin to move, N."""
    damping: Annotated[Number, usually(3.0, ge=0.0, le=100.0)]
    """N for each m a second."""
    mass: Annotated[Number, usually(0.05, ge=0.01, le=2.0)]
    """Of the button, kg."""

    def make(self, name: str) -> Fixture:
        """See `FixtureMaker.make`."""
        base = self.console()
        radius, out = self.diameter / 2, self.travel + 0.006
        ring = [placed(base.mount, box) for box in disc(radius + 0.012, 0.004, 0.002, STEEL, "metal")]
        cap = [placed(base.mount, box) for box in disc(radius, out, out / 2, RED)]
        into = poses.rotate(base.mount[3:], np.array([0.0, 0.0, -1.0])).tolist()
        part = FixturePart(
            name="button",
            boxes=tuple(cap),
            kind="slide",
            axis=(into[0], into[1], into[2]),
            limits=(0.0, self.travel),
            mass=self.mass,
            damping=self.damping,
            stiffness=self.stiffness,
            rest=-self.preload / self.stiffness,
        )
        return Fixture(name, self.pose(), (*base.boxes, *ring), (), (part,))
