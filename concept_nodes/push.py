"""Push: move an object along what it stands on, from behind it."""

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
from bt_tasksim.core.registry import register


@register("concept")
class Push(Shove):
    """Push an object along what it stands on (keeps contact: PC).

    The hand, its fingers closed or side by side, comes down behind the object, low and away from other
    things, and pushes it in a straight line. It leads back what drifts, becomes slower before the goal, and
    draws back so that it takes nothing along. The object's heading may change. With ``tool`` it pushes with
    what it holds.

    Args:
        target: The object.
        to: The place over whose origin its middle goes.
        position: Where its middle goes, robot base frame; the height is of no account.
        direction: Which way it goes, robot base frame, level.
        distance: How far it goes in ``direction``.
        tool: A held object with which it is pushed.
        speed: Peak speed.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    to: PlaceName | None = None
    position: Position | None = None
    direction: Direction | None = None
    distance: Metres | None = None
    tool: ObjectName | None = None
    speed: MetresPerSecond = 0.12
    force_limit: Newtons = FORCE_LIMIT

    presentation = Presentation(
        colour="#4f7f9b",
        spoken=r"push|shov|nudg",
        sayings=("I push the {} along", "push it over to the {}", "shove it there"),
        says_destination=True,
    )
