"""A cupboard with a sliding front."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from bt_tasksim.core.registry import register
from bt_tasksim.core.typed_file import Number
from bt_tasksim.scene.carpentry import DARK, LIGHT, PALE, HandleKind, board, frame, handle
from bt_tasksim.scene.fixture_maker import FixtureMaker, usually
from bt_tasksim.scene.fixtures import Fixture, FixturePart, FixturePlace

WALL, SHEET, RAIL = 0.02, 0.012, 0.014
"""Thickness of walls, of the front, and height of the rails, metres."""
LAP = 0.01
"""By how much the panel covers the front that stands still, metres."""
STANDS = 0.08
"""How far behind the front a thing stands that is put in without an offset, metres."""
_ACCESS = (math.cos(math.radians(20.0)), 0.0, -math.sin(math.radians(20.0)))


@register("fixture", "panel")
class Panel(FixtureMaker):
    """A `cupboard` one half of whose front is a `panel`, which slides sideways between rails."""

    width: Annotated[Number, usually(0.40, 0.46, ge=0.2, le=1.5)]
    """Of the whole front, m."""
    side: Annotated[Literal["left", "right"], usually("left", "right")]
    """Which half the panel shuts, as the robot sees it."""
    handle: Annotated[HandleKind, usually("bar", "knob")]
    """What to hold it by: an upright `bar`, or a `knob`."""
    base: Annotated[Number, usually(0.08, ge=0.02, le=1.0)]
    """Height of the board inside above the table, m."""
    height: Annotated[Number, usually(0.28, ge=0.15, le=1.5)]
    """Free height inside, m."""
    depth: Annotated[Number, usually(0.22, ge=0.08, le=0.6)]
    """Inside, from front to back, m."""
    value: Annotated[Number, usually(0.0, ge=0.0, le=1.0)]
    """How far it is open at the start, m."""
    mass: Annotated[Number, usually(0.5, 1.2, ge=0.05, le=40.0)]
    """Of the panel, kg."""
    friction: Annotated[Number, usually(2.0, 5.0, ge=0.0, le=200.0)]
    """What it takes to move it, N."""
    damping: Annotated[Number, usually(2.0, 5.0, ge=0.0, le=500.0)]
    """N for each m a second."""

    def make(self, name: str) -> Fixture:
        """See `FixtureMaker.make`."""
        left, half, top = 1.0 if self.side == "left" else -1.0, self.width / 2, self.base + self.height
        opens = half - WALL - LAP
        middle, panel = (self.base + top) / 2, -SHEET - 0.002
        face = panel - SHEET / 2
        grip = handle(self.handle, frame((face, left * half / 2, middle), (-1, 0, 0), (0, 0, 1)))
        leaf = board(
            (panel, left * (half - WALL - LAP) / 2, middle),
            (SHEET, half - WALL + LAP, self.height - 0.002),
            PALE,
        )
        part = FixturePart(
            name="panel",
            boxes=(leaf, *grip.boxes),
            kind="slide",
            axis=(0.0, -left, 0.0),
            limits=(0.0, opens),
            mass=self.mass,
            friction=self.friction,
            damping=self.damping,
            value=(self.value, self.value),
            grasps=grip.grasps,
        )
        inside = FixturePlace(
            name="cupboard",
            kind="board",
            position=(STANDS, left * half / 2, self.base),
            extent=(self.depth, half - WALL),
            centre=(self.depth / 2 - STANDS, 0.0),
            height=self.height,
            access=_ACCESS,
            exit=(-1.0, 0.0, 0.0),
            clearance=0.17,
        )
        reach = self.depth - panel + SHEET / 2
        deep = (self.depth + face) / 2
        boxes = (
            board((self.depth / 2, 0.0, self.base / 2), (self.depth, self.width, self.base), LIGHT),
            board((self.depth / 2, 0.0, top + WALL / 2), (self.depth, self.width, WALL), LIGHT),
            *(
                board((deep, side * (half - WALL / 2), middle), (reach, WALL, self.height), DARK)
                for side in (-1.0, 1.0)
            ),
            board((self.depth + WALL / 2, 0.0, (top + WALL) / 2), (WALL, self.width, top + WALL), DARK),
            board((-SHEET / 2 + 0.004, -left * half / 2, middle), (0.008, half - WALL, self.height), LIGHT),
            *(
                board((face / 2 - 0.004, 0.0, z), (0.008 - face, self.width, RAIL), DARK)
                for z in (self.base - RAIL / 2, top + RAIL / 2)
            ),
        )
        return Fixture(name, self.pose(), boxes, (inside,), (part,))
