"""Conditions about the hand: empty, with an object lifted in it, or with one over where it should go."""

from __future__ import annotations

from typing import Any

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.parameters import Flag, Metres, ObjectName, PlaceName, Ratio
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.destination import destination
from bt_tasksim.concept_nodes.grasp_pose import half_extent
from bt_tasksim.concept_nodes.holding import holding, tool_distance
from bt_tasksim.concept_nodes.surface import NEAR, apart, carrying, edges
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import COUNT, METRES, SHARE
from bt_tasksim.scene.spatial_laws import beyond_edges
from bt_tasksim.scene.specs import Goal

HAND = Form(
    "the hand is {closure} closed, {contacts} fingertips in contact, nearest object {distance} away",
    {"closure": SHARE, "contacts": COUNT, "distance": METRES},
)
ABOVE = Form("{object} is {height} above what is below it", {"height": METRES})
ASIDE = Form("{object} is {aside} beside and {height} above {place}", {"aside": METRES, "height": METRES})
APART = Form("{object} is {gap} from {other}, {height} higher", {"gap": METRES, "height": METRES})
SUNK = -0.005
"""Height in metres above what it is over, down to which an object is over it, as far as estimates tell."""
FAR = 10.0
"""Metres away that a thing is taken to be where there is none."""


@register("concept")
class HandEmpty(Condition):
    """Is the hand open, and clear of everything, so that it may set out for another object?

    Args:
        clearance: How far the tool should be from the nearest object.
        closure: Closure below which the hand counts as open.
    """

    clearance: Metres = 0.03
    closure: Ratio = 0.15

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        touching = array_namespace(seen.tool).any(seen.contacts, axis=-1)
        return (seen.closure < self.closure) & ~touching & (_nearest(seen) > self.clearance)

    def explain(self, seen: Seen) -> Statement:
        """How far it is closed, what it touches, and how far away the nearest object is."""
        xp = array_namespace(seen.tool)
        contacts = xp.count_nonzero(seen.contacts, axis=-1)
        return HAND(closure=seen.closure, contacts=contacts, distance=_nearest(seen))


@register("concept")
class Lifted(Condition):
    """Does the object hang in the hand, clear of what is below it?

    Args:
        target: The object.
        above: The place over which its height is asked; by default the nearest one below it.
        height: How high its lowest point should be above that place.
        tolerance: How much lower it may be.
    """

    target: ObjectName
    above: PlaceName | None = None
    height: Metres = 0.05
    tolerance: Metres = 0.02

    relation = "lifted"
    in_hand = True

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`."""
        return {"target": goal.object, "above": goal.place or None, "height": goal.height}

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return holding(seen, self.target) & (self._height(seen) > self.height - self.tolerance)

    def explain(self, seen: Seen) -> Statement:
        """How high it is."""
        return ABOVE(object=self.target, height=self._height(seen))

    def _height(self, seen: Seen) -> Array:
        now, model = seen.object(self.target), seen.model(self.target)
        if self.above is not None:
            return height_above(seen, self.target, destination(seen, self.above)[0])
        found, xp = carrying(seen, self.target), array_namespace(now)
        up = poses.constant([0.0, 0.0, 1.0], now) + xp.zeros_like(now[:, :3])
        height = poses.localise(found.place.pose, now[:, :3])[:, 2]
        return xp.where(found.found, height, xp.full_like(height, FAR)) - half_extent(now, model, up)


@register("concept")
class Over(Condition):
    """Is the held object over where it is to be put down or let go?

    Args:
        target: The object.
        place: The place, or another object.
        tolerance: How far it may be beside the place's origin.
        anywhere: Anywhere over the place will do.
    """

    target: ObjectName
    place: PlaceName
    tolerance: Metres = 0.03
    anywhere: Flag = False

    in_hand = True

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        aside, height = self._off(seen)
        near = aside <= (0.0 if self.anywhere else self.tolerance)
        return holding(seen, self.target) & near & (height > SUNK)

    def explain(self, seen: Seen) -> Statement:
        """How far beside and above it is."""
        aside, height = self._off(seen)
        return ASIDE(object=self.target, aside=aside, height=height, place=self.place)

    def _off(self, seen: Seen) -> tuple[Array, Array]:
        frame, rim = destination(seen, self.place)
        now = seen.object(self.target)
        if self.anywhere:
            aside = beyond_edges(frame, *edges(seen, self.place), now)
        else:
            aside = poses.norm(poses.localise(frame, now[:, :3])[:, :2])
        return aside, height_above(seen, self.target, frame) - rim


@register("concept")
class OverBeside(Condition):
    """Is the held object over where it is to be put down next to another one?

    Args:
        target: The object.
        other: The other one.
        gap: How much room there may be between their bounding boxes.
    """

    target: ObjectName
    other: ObjectName
    gap: Metres = NEAR

    in_hand = True

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        gap, height = apart(seen, self.target, self.other)
        return holding(seen, self.target) & (gap < self.gap) & (height > SUNK)

    def explain(self, seen: Seen) -> Statement:
        """How far apart they are."""
        gap, height = apart(seen, self.target, self.other)
        return APART(object=self.target, gap=gap, other=self.other, height=height)


def height_above(seen: Seen, target: str, frame: Array) -> Array:
    """Height ``(N,)`` in metres of an object's lowest point above the frames ``(N, 7)`` of surfaces."""
    now, up = seen.object(target), poses.z_axis(frame[:, 3:])
    return poses.localise(frame, now[:, :3])[:, 2] - half_extent(now, seen.model(target), up)


def _nearest(seen: Seen) -> Array:
    """Distance ``(N,)`` in metres of the tool from the nearest object that is seen."""
    xp = array_namespace(seen.tool)
    nearest = xp.full_like(seen.closure, FAR)
    for name, column in seen.world.columns.items():
        gap = tool_distance(seen, name)
        there = seen.world.object_facts.present[:, column] & xp.isfinite(gap)
        nearest = xp.where(there, xp.minimum(nearest, gap), nearest)
    return nearest
