"""Controls on a console: knobs, valves, levers and buttons."""

from __future__ import annotations

from typing import Annotated

from bt_tasksim.core.typed_file import Number
from bt_tasksim.scene.carpentry import Console, Facing, console
from bt_tasksim.scene.fixture_maker import FixtureMaker, usually


class ControlMaker(FixtureMaker):
    """Makes something that is worked on the top of a console, or on its front."""

    x: Annotated[Number, usually(0.52, 0.58, ge=-5.0, le=5.0)]
    """Where the console's front is, or the middle of one that looks up, robot base frame, m."""
    facing: Annotated[Facing, usually("up", "front")]
    """Whether it is on the top of the console, or on its front."""
    height: Annotated[Number, usually(0.16, 0.26, ge=0.03, le=1.2)]
    """Of the top above the table, or of the control's middle on the front, m."""

    def console(self) -> Console:
        """What it is mounted on."""
        return console(self.facing, self.height)
