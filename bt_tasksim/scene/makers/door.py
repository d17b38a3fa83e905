"""A cabinet with a door."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import register
from bt_tasksim.core.typed_file import Number
from bt_tasksim.scene.carpentry import DARK, LIGHT, PALE, HandleKind, board, frame, handle
from bt_tasksim.scene.fixture_maker import FixtureMaker, usually
from bt_tasksim.scene.fixtures import Fixture, FixturePart, FixturePlace

WALL, DOOR, EDGE = 0.02, 0.018, 0.035
"""Thickness of walls and of the door, and how far the handle is from the door's free edge, metres."""
STANDS = 0.08
"""How far behind the front a thing stands that is put in without an offset, metres."""
_ACCESS = (math.cos(math.radians(20.0)), 0.0, -math.sin(math.radians(20.0)))


@register("fixture", "door")
class Door(FixtureMaker):
    """A cabinet with a `door` in front of the `cabinet` board inside; the door opens towards the robot."""

    radius: Annotated[Number, usually(0.22, 0.27, ge=0.08, le=0.7)]
    """From the hinge to the handle, m."""
    side: Annotated[Literal["left", "right"], usually("left", "right")]
    """Where the hinge is, as the robot sees it."""
    handle: Annotated[HandleKind, usually("bar", "knob")]
    """What to hold it by: an upright `bar`, or a `knob`."""
    handle_height: Annotated[Number, usually(0.18, 0.26, ge=0.05, le=1.5)]
    """Of the handle's middle above the table, m."""
    base: Annotated[Number, usually(0.06, ge=0.02, le=1.0)]
    """Height of the board inside above the table, m."""
    height: Annotated[Number, usually(0.30, ge=0.15, le=1.5)]
    """Free height inside, m."""
    depth: Annotated[Number, usually(0.24, ge=0.08, le=0.6)]
    """Inside, from front to back, m."""
    opens: Annotated[Number, usually(1.75, ge=0.2, le=3.0)]
    """How far it can be opened, rad."""
    value: Annotated[Number, usually(0.0, ge=0.0, le=3.0)]
    """How far it is open at the start, rad."""
    mass: Annotated[Number, usually(1.0, 2.0, ge=0.05, le=40.0)]
    """Of the door, kg."""
    friction: Annotated[Number, usually(0.2, 0.6, ge=0.0, le=50.0)]
    """What it takes to turn it, Nm."""
    damping: Annotated[Number, usually(0.1, 0.3, ge=0.0, le=50.0)]
    """Nm for each rad a second."""
    spring: Annotated[Number, usually(0.0, ge=0.0, le=50.0)]
    """Of the spring that shuts it, Nm/rad."""
    latch: Annotated[Number, usually(0.0, ge=0.0, le=100.0)]
    """What a latch holds it shut with, Nm."""

    def make(self, name: str) -> Fixture:
        """See `FixtureMaker.make`."""
        low, high = self.base + 0.09, self.base + self.height - 0.05
        if not low <= self.handle_height <= high:
            raise InputError(
                f"its handle is {self.handle_height:.2f} m above the table, and its door has room for one "
                f"from {low:.2f} to {high:.2f} m"
            )
        width, top = self.radius + EDGE, self.base + self.height
        left = 1.0 if self.side == "left" else -1.0
        hinge = left * width / 2
        grip = handle(
            self.handle, frame((-DOOR, hinge - left * self.radius, self.handle_height), (-1, 0, 0), (0, 0, 1))
        )
        leaf = board(
            (-DOOR / 2, 0.0, (self.base + top + WALL) / 2), (DOOR, width, top + WALL - self.base), PALE
        )
        part = FixturePart(
            name="door",
            boxes=(leaf, *grip.boxes),
            kind="hinge",
            axis=(0.0, 0.0, -left),
            origin=(0.0, hinge, 0.0),
            limits=(0.0, self.opens),
            mass=self.mass,
            friction=self.friction,
            damping=self.damping,
            stiffness=self.spring,
            latch=self.latch,
            value=(self.value, self.value),
            grasps=grip.grasps,
        )
        inside = FixturePlace(
            name="cabinet",
            kind="board",
            position=(STANDS, 0.0, self.base),
            extent=(self.depth, width - 2 * WALL),
            centre=(self.depth / 2 - STANDS, 0.0),
            height=self.height,
            access=_ACCESS,
            exit=(-1.0, 0.0, 0.0),
            clearance=0.17,
        )
        boxes = (
            board((self.depth / 2, 0.0, self.base / 2), (self.depth, width, self.base), LIGHT),
            board((self.depth / 2, 0.0, top + WALL / 2), (self.depth, width, WALL), LIGHT),
            *(
                board(
                    (self.depth / 2, side * (width - WALL) / 2, (self.base + top) / 2),
                    (self.depth, WALL, self.height),
                    DARK,
                )
                for side in (-1.0, 1.0)
            ),
            board((self.depth + WALL / 2, 0.0, (top + WALL) / 2), (WALL, width, top + WALL), DARK),
        )
        return Fixture(name, self.pose(), boxes, (inside,), (part,))
