"""Slide off: move a held object away from a stop, along what it is pressed on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.demonstrated import straight_words
from bt_tasksim.concept.parameters import Direction, Metres, MetresPerSecond, Newtons, ObjectName
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT
from bt_tasksim.concept_nodes.slid import Slid, SlidMemory, level, not_level
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register


@register("concept")
class SlideOff(Slid):
    """Slide a held object off a stop, along what it is pressed on (breaks contact: OT to TR).

    Args:
        target: The held object.
        direction: Which way it goes, away from the stop, robot base frame, level.
        distance: How far it goes.
        press: Force with which it presses on what it slides on.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    direction: Direction
    distance: Metres = 0.08
    press: Newtons = 4.0
    speed: MetresPerSecond = 0.08
    force_limit: Newtons = FORCE_LIMIT

    contact = ContactChange(ContactState.OT, ContactState.TR)
    presentation = Presentation(
        colour="#8f6f3a",
        spoken=r"off the (?:edge|wall|stop)|away from the (?:edge|wall|stop)",
        sayings=("slide it off the wall", "away from the stop"),
    )

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Which way, and how far."""
        return straight_words(parameters) if "distance" in parameters else ""

    def contradiction(self) -> str:
        """A way that is level."""
        return not_level(self.direction)

    def waypoints(self, seen: Seen) -> Sequence[Array]:
        """See `Slid.waypoints`."""
        nothing = array_namespace(seen.tool).zeros_like(seen.tool[:, :3])
        return (level(self.direction, self.distance, seen.tool) + nothing,)

    def _ended(self, seen: Seen, memory: SlidMemory) -> Array:
        """It has come its way, and the tool is there."""
        gone = poses.dot(seen.tool[:, :3] - memory.path.table[:, 0, :3], memory.along)
        return (memory.progress >= memory.path.duration) & (gone >= self.distance - self.tolerance)
