"""Pull: draw an object along what it stands on, from its far side, or by its top."""

from __future__ import annotations

from bt_tasksim.concept.parameters import (
    Direction,
    Metres,
    MetresPerSecond,
    Newtons,
    ObjectName,
    PlaceName,
    Position,
)
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT
from bt_tasksim.concept_nodes.shove import Shove
from bt_tasksim.concept_nodes.shoved_way import ShovedWay, pressed_way, shoved_way
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register


@register("concept")
class Pull(Shove):
    """Draw an object along what it stands on (keeps contact: PC).

    The hand comes down on the far side of the object, as seen from where that is to go, and draws it along as
    `Push` does. Where the arm does not reach there, or has no room, fingertips press lightly on the object's
    top and take it along by friction. With ``tool`` it is drawn with what the hand holds.

    Args:
        target: The object.
        to: The place over whose origin its middle goes.
        position: Where its middle goes, robot base frame; the height is of no account.
        direction: Which way it goes, robot base frame, level.
        distance: How far it goes in ``direction``.
        tool: A held object with which it is drawn.
        press: Force with which fingertips press on its top, where they do.
        speed: Peak speed.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    to: PlaceName | None = None
    position: Position | None = None
    direction: Direction | None = None
    distance: Metres | None = None
    tool: ObjectName | None = None
    press: Newtons = 12.0
    speed: MetresPerSecond = 0.12
    force_limit: Newtons = FORCE_LIMIT

    presentation = Presentation(
        colour="#4f9b8a",
        spoken=r"pull|draw .* (?:to|near)|drag",
        sayings=("I pull the {} over here", "draw it to the {}", "drag it nearer"),
        says_destination=True,
    )

    def _way(self, view: WorldView, goal: Array) -> ShovedWay:
        try:
            return shoved_way(view, self.target, goal, self.tool, self.tolerance)
        except NoWayError as error:
            if self.tool is not None:
                raise
            reason = error.with_traceback(None)
        try:
            return pressed_way(view, self.target, goal, self.tolerance)
        except NoWayError:
            raise reason from None

    @property
    def _press(self) -> float:
        return self.press
