"""A box with a lid."""

from __future__ import annotations

from typing import Annotated, Literal

from bt_tasksim.core.registry import register
from bt_tasksim.core.typed_file import Number
from bt_tasksim.scene.carpentry import DARK, LIGHT, PALE, STEEL, Made, board, frame, handle, held
from bt_tasksim.scene.fixture_maker import FixtureMaker, usually
from bt_tasksim.scene.fixtures import Fixture, FixturePart, FixturePlace

WALL, LID = 0.01, 0.012
"""Thickness of walls and of the lid, metres."""
EDGE = (0.05, 0.03, LID)
"""Size of what sticks out of the lid's edge to lift it by, metres."""


@register("fixture", "lidded_box")
class LiddedBox(FixtureMaker):
    """A box whose `lid` is hinged at the back; things go into the place that has the fixture's name."""

    x: Annotated[Number, usually(0.44, 0.50, ge=-5.0, le=5.0)]
    """Where its front is, robot base frame, m."""
    length: Annotated[Number, usually(0.18, 0.22, ge=0.08, le=0.8)]
    """From front to back, m."""
    width: Annotated[Number, usually(0.20, 0.26, ge=0.08, le=0.8)]
    """From side to side, m."""
    height: Annotated[Number, usually(0.10, 0.14, ge=0.03, le=0.8)]
    """Without the lid, m."""
    handle: Annotated[Literal["knob", "edge"], usually("knob", "edge")]
    """What to lift it by: a `knob` on the lid, or an `edge` that sticks out in front."""
    opens: Annotated[Number, usually(1.9, ge=0.3, le=3.1)]
    """How far it can be opened, rad; beyond 1.6 it stays open."""
    value: Annotated[Number, usually(0.0, ge=0.0, le=3.1)]
    """How far it is open at the start, rad."""
    mass: Annotated[Number, usually(0.15, 0.35, ge=0.02, le=20.0)]
    """Of the lid, kg."""
    friction: Annotated[Number, usually(0.01, 0.03, ge=0.0, le=20.0)]
    """What it takes to turn it, besides its weight, Nm."""
    damping: Annotated[Number, usually(0.01, 0.03, ge=0.0, le=20.0)]
    """Nm for each rad a second."""
    latch: Annotated[Number, usually(0.0, ge=0.0, le=50.0)]
    """What a latch holds it shut with, Nm."""

    def make(self, name: str) -> Fixture:
        """See `FixtureMaker.make`."""
        grip = self._handle()
        lid = board((self.length / 2, 0.0, self.height + LID / 2), (self.length, self.width, LID), PALE)
        part = FixturePart(
            name="lid",
            boxes=(lid, *grip.boxes),
            kind="hinge",
            axis=(0.0, 1.0, 0.0),
            origin=(self.length, 0.0, self.height),
            limits=(0.0, self.opens),
            mass=self.mass,
            friction=self.friction,
            damping=self.damping,
            latch=self.latch,
            value=(self.value, self.value),
            grasps=grip.grasps,
        )
        inside = FixturePlace(
            name=name,
            kind="bin",
            position=(self.length / 2, 0.0, WALL),
            extent=(self.length - 2 * WALL, self.width - 2 * WALL),
            centre=(0.0, 0.0),
            height=self.height - WALL,
            access=(0.0, 0.0, -1.0),
            exit=(0.0, 0.0, 1.0),
            clearance=0.12,
        )
        middle, high = (self.height + WALL) / 2, self.height - WALL
        boxes = (
            board((self.length / 2, 0.0, WALL / 2), (self.length, self.width, WALL), LIGHT),
            *(
                board((x, 0.0, middle), (WALL, self.width, high), DARK)
                for x in (WALL / 2, self.length - WALL / 2)
            ),
            *(
                board(
                    (self.length / 2, side * (self.width - WALL) / 2, middle),
                    (self.length - 2 * WALL, WALL, high),
                    DARK,
                )
                for side in (-1.0, 1.0)
            ),
        )
        return Fixture(name, self.pose(), boxes, (inside,), (part,))

    def _handle(self) -> Made:
        """What to lift the lid by; the hand may come from anywhere across its fingers."""
        if self.handle == "knob":
            at = frame((0.03, 0.0, self.height + LID), (0, 0, 1), (0, 1, 0))
            made = handle("knob", at)
            along = [grip for grip in made.grasps if abs(grip.closing[1]) > 0.5]
            return Made(made.boxes, tuple(held(_HERE, g.point, g.closing, g.width, None) for g in along))
        middle = (-EDGE[0] / 2, 0.0, self.height + LID / 2)
        tip = (-EDGE[0] + 0.015, 0.0, self.height + LID / 2)
        return Made(
            (board(middle, EDGE, STEEL, "metal"),), (held(_HERE, tip, (0.0, 1.0, 0.0), EDGE[1], None),)
        )


_HERE = frame((0.0, 0.0, 0.0), (0, 0, 1), (1, 0, 0))
