"""Conditions about how things stand to each other: in, on and beside one another, and with room between."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.functions import booleans
from bt_tasksim.concept.parameters import Flag, Metres, ObjectName, PlaceName
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.bring import destination, standing_pose
from bt_tasksim.concept_nodes.grasp_pose import half_extent
from bt_tasksim.concept_nodes.hand_conditions import height_above, how_far_apart
from bt_tasksim.concept_nodes.inside_of import beyond_walls
from bt_tasksim.concept_nodes.surface import NEAR, apart, edges, straight_down
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array, array_namespace, constant, host
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES
from bt_tasksim.scene.specs import Goal

WITHIN = Form(
    "{object} is {aside} off the middle of {place}, {height} above its floor",
    {"aside": METRES, "height": METRES},
)
STANDS = Form("{object} is {aside} off and {height} above {place}", {"aside": METRES, "height": METRES})
ROOM = Form("{place} {state}")
FINE = 15
"""Points along each side of a place at which room is looked for."""
LEVEL = 0.02
"""Metres between what is on a surface and the surface, as far as estimates tell."""


@register("concept")
class Inside(Condition):
    """Is the object in the container: below its rim, or standing on its floor?

    Args:
        target: The object.
        place: The container, or another object that holds it.
    """

    target: ObjectName
    place: PlaceName

    relation = "inside"

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return beyond_walls(seen, self.target, self.place) <= 0.0

    def explain(self, seen: Seen) -> Statement:
        """Where it is."""
        local = self._local(seen)
        aside = poses.norm(local[:, :2])
        return WITHIN(object=self.target, aside=aside, height=local[:, 2], place=self.place)

    def _local(self, seen: Seen) -> Array:
        known = self.place in seen.world.place_columns
        frame = seen.place(self.place).pose if known else seen.object(self.place)
        return poses.localise(frame, seen.object(self.target)[:, :3])


@register("concept")
class StandsOn(Condition):
    """Does the object stand or lie on the place, wherever on it?

    Args:
        target: The object.
        place: The place, or another object.
    """

    target: ObjectName
    place: PlaceName

    relation = "anywhere"

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        local, height = self._local(seen)
        centre, half = edges(seen, self.place)
        xp = array_namespace(local)
        return xp.all(abs(local[:, :2] - centre) <= half, axis=-1) & (abs(height) < LEVEL)

    def explain(self, seen: Seen) -> Statement:
        """Where it is."""
        local, height = self._local(seen)
        return STANDS(object=self.target, aside=poses.norm(local[:, :2]), height=height, place=self.place)

    def _local(self, seen: Seen) -> tuple[Array, Array]:
        frame, _ = destination(seen, self.place)
        local = poses.localise(frame, seen.object(self.target)[:, :3])
        return local, height_above(seen, self.target, frame)


@register("concept")
class Beside(Condition):
    """Does the object stand next to another one, on the same level?

    Args:
        target: The object.
        other: The other one.
        gap: How much room there may be between their bounding boxes.
    """

    target: ObjectName
    other: ObjectName
    gap: Metres = NEAR

    relation = "beside"

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`."""
        return {"target": goal.object, "other": goal.place, "gap": goal.distance}

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        gap, height = apart(seen, self.target, self.other)
        return (gap < self.gap) & (abs(height) < LEVEL)

    def explain(self, seen: Seen) -> Statement:
        """How far apart they are."""
        return how_far_apart(seen, self.target, self.other)


@register("concept")
class Clear(Condition):
    """Is the place free? An object counts as a place: nothing is on it.

    Args:
        place: The place, or an object.
        target: What is to stand on the place's origin: other objects may be on the place then, as long as
            they leave room for it. None: nothing at all may be there.
        margin: Room that is left around the target.
        anywhere: There has to be room for the target somewhere on the place, wherever that is.
    """

    place: PlaceName
    target: ObjectName | None = None
    margin: Metres = 0.0
    anywhere: Flag = False

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        free = booleans(seen.tool, True)[:, None]
        for there in self._occupied(seen).values():
            free = free & ~there
        return array_namespace(free).any(free, axis=-1)

    def explain(self, seen: Seen) -> Statement:
        """What is there."""
        found = {name: host(there) for name, there in self._occupied(seen).items()}
        free, states = host(self.holds(seen)), []
        taken = "has no room beside" if self.anywhere else "is taken by"
        for world in range(seen.tool.shape[0]):
            names = [name for name, there in found.items() if bool(there[world].any())]
            states.append("is free" if free[world] else f"{taken} {', '.join(names)}")
        return ROOM(place=self.place, state=tuple(states))

    def _occupied(self, seen: Seen) -> dict[str, Array]:
        """By object, booleans ``(N, k)``: it is in the way of the spots that are asked about."""
        frame, _ = destination(seen, self.place)
        xp = array_namespace(frame)
        up = poses.z_axis(frame[:, 3:])
        middle, half = edges(seen, self.place)
        room: Array | float = LEVEL
        spots = middle[:, None, :]
        if self.target is not None:
            model, now = seen.model(self.target), seen.object(self.target)
            stands = straight_down(frame, now, model) if self.anywhere else standing_pose(frame, now, model)
            own = _footprint(seen, self.target, stands, frame)
            spots = poses.localise(frame, stands[:, :3])[:, None, :2]
            if self.anywhere:
                spots = middle[:, None, :] + poses.clip(half - own, 0.0, math.inf)[:, None, :] * _grid(middle)
            half, room = own + self.margin, 2.0 * half_extent(stands, model, up)
        found = {}
        for name, column in seen.world.columns.items():
            if name in (self.place, self.target):
                continue
            pose = seen.object(name)
            beside = abs(poses.localise(frame, pose[:, :3])[:, None, :2] - spots)
            meets = xp.all(beside < (half + _footprint(seen, name, pose, frame))[:, None, :], axis=-1)
            height = height_above(seen, name, frame)
            there = seen.world.object_facts.present[:, column]
            found[name] = (there & (height > -LEVEL) & (height < room))[:, None] & meets
        return found


def _grid(like: Array) -> Array:
    """Points ``(1, k, 2)`` all over a square from -1 to 1."""
    steps = np.linspace(-1.0, 1.0, FINE)
    return constant(np.stack(np.meshgrid(steps, steps), axis=-1).reshape(1, -1, 2), like)


def _footprint(seen: Seen, name: str, pose: Array, frame: Array) -> Array:
    """Half sizes ``(N, 2)`` of an object's bounding box along the x and y axes of frames ``(N, 7)``."""
    xp, model, out = array_namespace(pose), seen.model(name), []
    for axis in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]):
        along = xp.zeros_like(pose[:, :3]) + constant(axis, pose)
        out.append(half_extent(pose, model, poses.rotate(frame[:, 3:], along)))
    return xp.stack(out, axis=-1)
