"""Slide off: move a held object away from a stop, along what it is pressed on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.demonstrated import straight_words
from bt_tasksim.concept.parameters import (
    Direction,
    Metres,
    MetresPerSecond,
    Newtons,
    ObjectName,
    PlaceName,
)
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.level_way import not_level
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT
from bt_tasksim.concept_nodes.shoved_way import touching_now
from bt_tasksim.concept_nodes.slid import GOOD, SHARES, Slid, SlidMemory
from bt_tasksim.concept_nodes.stops import CLEAR, gaps, nearest_stop, no_way_named, way_in, ways_in
from bt_tasksim.concept_nodes.tipping import support_of
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, constant
from bt_tasksim.core.registry import register

NEAR = 0.02
"""Metres from a stop up to which it counts as standing against that when it is grasped."""


@register("concept")
class SlideOff(Slid):
    """Slide a held object off a stop, along what it is pressed on (breaks contact: OT to TR).

    Args:
        target: The held object.
        direction: Which way it goes, away from the stop, robot base frame, level; by default straight away
            from the nearest wall of ``off``.
        distance: How far it goes.
        off: The place or the object that it leaves.
        press: Force with which it presses on what it slides on.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    direction: Direction | None = None
    distance: Metres = 0.08
    off: PlaceName | None = None
    press: Newtons = 4.0
    speed: MetresPerSecond = 0.08
    force_limit: Newtons = FORCE_LIMIT

    establishes = (ConditionOf("ClearOf", target="target", other="off"),)
    contact = ContactChange(ContactState.OT, ContactState.TR)
    presentation = Presentation(
        colour="#8f6f3a",
        spoken=r"off the (?:edge|wall|stop)|away from the (?:edge|wall|stop)",
        sayings=("slide it off the wall", "away from the stop"),
    )

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Which way, and how far."""
        return straight_words(parameters) if {"direction", "distance"} <= parameters.keys() else ""

    def contradiction(self) -> str:
        """A way that is level, or what it leaves."""
        return not_level(self.direction) or no_way_named(self.direction, self.off, "off")

    def waypoints(self, seen: Seen, each: Sequence[WorldView]) -> Sequence[Array]:
        """See `Slid.waypoints`."""
        distance = -self.distance if self.direction is None else self.distance
        ways = ways_in(each, self.target, self.direction, self.off, math.inf)
        return (distance * constant(ways, seen.tool),)

    def aim(self, view: WorldView) -> Aim | None:
        """To where it ends, where it stands against something now."""
        stop = nearest_stop(view, self.target, self.off)
        if stop is None or stop.gap > NEAR:
            return None
        along = way_in(view, self.target, self.direction, None)
        along = -stop.towards if along is None else along
        ways = [poses.shifted(view.objects[self.target], share * self.distance * along) for share in SHARES]
        supports = touching_now(view, self.target).union(support_of(view, self.target)[0])
        return Aim(np.array(ways), "be slid off a stop", supports, along=True)

    def missed(self, known: Known) -> Array:
        """What is missing of a clear gap to what it leaves, or of its way, over what is tolerable."""
        if self.off is not None:
            gap = gaps(known.world, known.hidden.objects, self.target, self.off)
            return poses.clip(1.0 - gap / CLEAR, 0.0, 1.0)
        now = known.object(self.target)[:, :3]
        if known.began is None:  # nobody knows where it was
            return now[:, 0] * 0.0
        way = now - Known(known.began, known.world).object(self.target)[:, :3]
        return poses.clip(self.distance - poses.norm(way[:, :2]), 0.0, math.inf) / GOOD

    def _ended(self, seen: Seen, memory: SlidMemory) -> Array:
        """It has come its way, and the tool is there."""
        gone = poses.dot(seen.tool[:, :3] - memory.path.table[:, 0, :3], memory.along)
        return (memory.progress >= memory.path.duration) & (gone >= self.distance - self.tolerance)
