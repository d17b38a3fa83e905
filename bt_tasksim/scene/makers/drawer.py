"""A chest with a drawer."""

from __future__ import annotations

from typing import Annotated

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import register
from bt_tasksim.core.typed_file import Number
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.carpentry import DARK, LIGHT, PALE, HandleKind, board, frame, handle
from bt_tasksim.scene.fixture_maker import FixtureMaker, usually
from bt_tasksim.scene.fixtures import Fixture, FixturePart, FixturePlace

WALL, SHEET, FRONT = 0.02, 0.008, 0.016
"""Thickness of the chest's walls, of the drawer's, and of its front, metres."""
GAP = 0.004
"""Between a drawer and what is about it, metres."""


@register("fixture", "drawer")
class Drawer(FixtureMaker):
    """A chest with a `drawer`, which comes out towards the robot and takes things in; its top is `chest`."""

    width: Annotated[Number, usually(0.26, 0.32, ge=0.10, le=1.0)]
    """Of the drawer, m."""
    depth: Annotated[Number, usually(0.26, 0.30, ge=0.10, le=0.8)]
    """Of the drawer, from front to back, m."""
    height: Annotated[Number, usually(0.10, 0.13, ge=0.05, le=0.5)]
    """Of the drawer's front, m."""
    base: Annotated[Number, usually(0.10, 0.16, ge=0.01, le=1.0)]
    """From the table to the drawer, m."""
    opens: Annotated[Number, usually(0.20, 0.24, ge=0.02, le=0.8)]
    """How far it comes out, m."""
    value: Annotated[Number, usually(0.0, ge=0.0, le=0.8)]
    """How far it is out at the start, m."""
    handle: Annotated[HandleKind, usually("bar", "knob")]
    """What to hold it by: a level `bar`, or a `knob`."""
    mass: Annotated[Number, usually(0.8, 2.0, ge=0.05, le=40.0)]
    """Of the drawer, kg."""
    friction: Annotated[Number, usually(2.0, 6.0, ge=0.0, le=200.0)]
    """What it takes to move it, N."""
    damping: Annotated[Number, usually(2.0, 6.0, ge=0.0, le=500.0)]
    """N for each m a second."""
    spring: Annotated[Number, usually(0.0, ge=0.0, le=2000.0)]
    """Of the spring that shuts it, N/m."""
    latch: Annotated[Number, usually(0.0, ge=0.0, le=100.0)]
    """What a latch holds it shut with, N."""

    def make(self, name: str) -> Fixture:
        """See `FixtureMaker.make`."""
        if self.opens > self.depth - 0.02:
            raise InputError(
                f"its drawer is {self.depth:.2f} m deep and comes out by {self.opens:.2f} m: it would fall "
                f"out of the chest"
            )
        depth, outer = self.depth + WALL + GAP, self.width + 2 * (WALL + GAP)
        top = self.base + self.height + GAP
        grip = handle(self.handle, frame((-FRONT, 0.0, self.base + self.height / 2), (-1, 0, 0), (0, 1, 0)))
        part = FixturePart(
            name="drawer",
            boxes=(*self._box(), *grip.boxes),
            kind="slide",
            axis=(-1.0, 0.0, 0.0),
            limits=(0.0, self.opens),
            mass=self.mass,
            friction=self.friction,
            damping=self.damping,
            stiffness=self.spring,
            latch=self.latch,
            value=(self.value, self.value),
            grasps=grip.grasps,
        )
        above = FixturePlace(
            name="chest",
            kind="board",
            position=(depth / 2, 0.0, top + WALL),
            extent=(depth, outer),
            centre=(0.0, 0.0),
            height=10.0,
            access=(0.0, 0.0, -1.0),
            exit=(0.0, 0.0, 1.0),
            clearance=0.12,
        )
        sides = [
            board(
                (depth / 2, side * (outer - WALL) / 2, (self.base + top) / 2),
                (depth, WALL, top - self.base),
                DARK,
            )
            for side in (-1.0, 1.0)
        ]
        boxes = (
            board((depth / 2, 0.0, self.base / 2), (depth, outer, self.base), LIGHT),
            *sides,
            board(
                (depth - WALL / 2, 0.0, (self.base + top) / 2),
                (WALL, outer - 2 * WALL, top - self.base),
                DARK,
            ),
            board((depth / 2, 0.0, top + WALL / 2), (depth, outer, WALL), LIGHT),
        )
        return Fixture(name, self.pose(), boxes, (above,), (part,))

    def _box(self) -> tuple[Box, ...]:
        """The drawer itself: a floor, three walls, and a front that covers the chest's sides halfway."""
        low, wall = self.base + GAP, self.height - 0.03
        middle = low + SHEET + wall / 2
        return (
            board((self.depth / 2, 0.0, low + SHEET / 2), (self.depth, self.width, SHEET), PALE),
            *(
                board(
                    (self.depth / 2, side * (self.width - SHEET) / 2, middle), (self.depth, SHEET, wall), PALE
                )
                for side in (-1.0, 1.0)
            ),
            board((self.depth - SHEET / 2, 0.0, middle), (SHEET, self.width - 2 * SHEET, wall), PALE),
            board(
                (-FRONT / 2, 0.0, self.base + self.height / 2),
                (FRONT, self.width + 2 * GAP, self.height),
                LIGHT,
            ),
        )
