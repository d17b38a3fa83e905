"""Conditions about how things stand to each other: in, on and beside one another, and with room between."""

from __future__ import annotations

from typing import Any

import numpy as np

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.functions import booleans
from bt_tasksim.concept.parameters import Flag, Metres, ObjectName, PlaceName, Radians
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.destination import destination, standing_pose
from bt_tasksim.concept_nodes.grasp_pose import half_extent
from bt_tasksim.concept_nodes.hand_conditions import height_above
from bt_tasksim.concept_nodes.spots import has_room
from bt_tasksim.concept_nodes.surface import NEAR, edges
from bt_tasksim.concept_nodes.view import views
from bt_tasksim.concept_nodes.whereabouts import Estimates
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array, array_namespace, constant, host, indices
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, RADIANS
from bt_tasksim.scene.spatial_laws import IsBeside, IsOn, beyond_walls, is_beside, is_on
from bt_tasksim.scene.specs import Goal

WITHIN = Form(
    "{object} is {aside} off the middle of {place}, {height} above its floor",
    {"aside": METRES, "height": METRES},
)
STANDS = Form(
    "{object} is {aside} beyond the edges of {place}, {height} above it, tilted by {angle:.0f}{upon}",
    {"aside": METRES, "height": METRES, "angle": RADIANS},
)
BESIDE = Form(
    "{object} is {gap} from {other}, {height} higher, and one of them tilted by {angle:.0f}",
    {"gap": METRES, "height": METRES, "angle": RADIANS},
)
UPON = ", on something else that is there"
ROOM = Form("{place} {state}")
LEVEL = 0.02
"""Metres between what is on a surface and the surface, as far as estimates tell."""


@register("concept")
class Inside(Condition):
    """Is the object in the container: below its rim, or standing on its floor?

    In another object it is where that is hollow: above its floor, and with walls around.

    Args:
        target: The object.
        place: The container, or another object that holds it.
    """

    target: ObjectName
    place: PlaceName

    relation = "inside"

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return beyond_walls(Estimates.of(seen), self.target, self.place) <= 0.0

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
    """Does the object stand upright on the place, wherever on it, and on nothing else that is there?

    Args:
        target: The object.
        place: The place, or another object.
        tolerance: How far its lowest point may seem to be above or below the surface.
        angle: How far it may be tilted.
    """

    target: ObjectName
    place: PlaceName
    tolerance: Metres = Goal.position_tolerance
    angle: Radians = Goal.angle_tolerance

    relation = "anywhere"
    leaves_open = True

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`."""
        return {"target": goal.object, "place": goal.place, **_tolerances(goal)}

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return self._found(seen).holds(self.tolerance, self.angle)

    def explain(self, seen: Seen) -> Statement:
        """Where it is."""
        found = self._found(seen)
        upon = tuple(UPON if there else "" for there in host(found.elsewhere).tolist())
        return STANDS(
            object=self.target,
            aside=found.aside,
            height=found.height,
            place=self.place,
            angle=found.lean,
            upon=upon,
        )

    def _found(self, seen: Seen) -> IsOn:
        key = ("is on", self.target, self.place)
        return seen.once(key, lambda: is_on(Estimates.of(seen), self.target, self.place))


@register("concept")
class Beside(Condition):
    """Does the object stand upright next to another one, on the same level?

    Args:
        target: The object.
        other: The other one.
        gap: How much room there may be between their outlines from above.
        tolerance: How far their lowest points may seem to differ in height.
        angle: How far each may be tilted.
    """

    target: ObjectName
    other: ObjectName
    gap: Metres = NEAR
    tolerance: Metres = Goal.position_tolerance
    angle: Radians = Goal.angle_tolerance

    relation = "beside"
    rests_on_place = False

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`."""
        return {"target": goal.object, "other": goal.place, "gap": goal.distance, **_tolerances(goal)}

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        found = self._found(seen)
        return found.holds(self.gap, self.tolerance, self.angle)

    def explain(self, seen: Seen) -> Statement:
        """How far apart they are, and how far tilted."""
        found = self._found(seen)
        angle = array_namespace(found.lean).maximum(found.lean, found.other_lean)
        return BESIDE(object=self.target, gap=found.gap, other=self.other, height=found.height, angle=angle)

    def _found(self, seen: Seen) -> IsBeside:
        key = ("is beside", self.target, self.other)
        return seen.once(key, lambda: is_beside(Estimates.of(seen), self.target, self.other))


@register("concept")
class Clear(Condition):
    """Is the place free? An object counts as a place: nothing is on it.

    Args:
        place: The place, or an object.
        target: What is to stand on the place's origin: other objects may be on the place then, as long as
            they leave room for it. None: nothing at all may be there.
        margin: Room that is left around the target.
        anywhere: There has to be room for the target somewhere on the place: a free spot that `Bring` would
            find.
    """

    place: PlaceName
    target: ObjectName | None = None
    margin: Metres = 0.0
    anywhere: Flag = False

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        if self.anywhere and self.target is not None:
            return indices(np.array(self._rooms(seen, self.target)), seen.tool)
        free = booleans(seen.tool, True)
        for there in self._occupied(seen).values():
            free = free & ~there
        return free

    def explain(self, seen: Seen) -> Statement:
        """What is there."""
        if self.anywhere and self.target is not None:
            rooms = self._rooms(seen, self.target)
            return ROOM(
                place=self.place,
                state=tuple("has room" if room else f"has no room for {self.target}" for room in rooms),
            )
        found = {name: host(there) for name, there in self._occupied(seen).items()}
        free, states = host(self.holds(seen)), []
        for world in range(seen.tool.shape[0]):
            names = [name for name, there in found.items() if bool(there[world])]
            states.append("is free" if free[world] else f"is taken by {', '.join(names)}")
        return ROOM(place=self.place, state=tuple(states))

    def _rooms(self, seen: Seen, target: str) -> list[bool]:
        """Of each world, whether there is room for the target: a search, one world after the other."""
        key = ("has room", self.place, target, self.margin)
        return seen.once(key, lambda: [has_room(v, target, self.place, self.margin) for v in views(seen)])

    def _occupied(self, seen: Seen) -> dict[str, Array]:
        """By object, booleans ``(N,)``: it is in the way."""
        frame, _ = destination(seen, self.place)
        xp = array_namespace(frame)
        spot, half = edges(seen, self.place)
        room: Array | float = LEVEL
        if self.target is not None:
            model, now = seen.model(self.target), seen.object(self.target)
            stands = standing_pose(frame, now, model)
            spot = poses.localise(frame, stands[:, :3])[:, :2]
            half = _footprint(seen, self.target, stands, frame) + self.margin
            room = 2.0 * half_extent(stands, model, poses.z_axis(frame[:, 3:]))
        found, free = {}, booleans(seen.tool, True)
        if self.target is None and self.place not in seen.world.place_columns:
            free = ~seen.model(self.place).jointed  # what is in a drawer or on it goes along with it
        for name, column in seen.world.columns.items():
            if name in (self.place, self.target):
                continue
            pose = seen.object(name)
            beside = abs(poses.localise(frame, pose[:, :3])[:, :2] - spot)
            meets = xp.all(beside < half + _footprint(seen, name, pose, frame), axis=-1)
            height = height_above(seen, name, frame)
            there = seen.world.object_facts.present[:, column]
            found[name] = free & there & (height > -LEVEL) & (height < room) & meets
        return found


def _tolerances(goal: Goal) -> dict[str, float]:
    """Arguments of conditions for what a goal asks for other than usual."""
    asked = {
        "tolerance": (goal.position_tolerance, Goal.position_tolerance),
        "angle": (goal.angle_tolerance, Goal.angle_tolerance),
    }
    return {name: value for name, (value, usual) in asked.items() if value != usual}


def _footprint(seen: Seen, name: str, pose: Array, frame: Array) -> Array:
    """Half sizes ``(N, 2)`` of an object's bounding box along the x and y axes of frames ``(N, 7)``."""
    xp, model, out = array_namespace(pose), seen.model(name), []
    for axis in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]):
        along = xp.zeros_like(pose[:, :3]) + constant(axis, pose)
        out.append(half_extent(pose, model, poses.rotate(frame[:, 3:], along)))
    return xp.stack(out, axis=-1)
