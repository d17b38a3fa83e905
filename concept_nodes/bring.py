"""Bring: carry a held object through free space to a place, clear of everything on the way."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.context import Seen
from bt_tasksim.concept.demonstrated import position_words, rounded, rounded_points
from bt_tasksim.concept.parameters import (
    Metres,
    MetresPerSecond,
    Newtons,
    ObjectName,
    PlaceName,
    Points,
    Position,
)
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes.carry import Carry, MoveMemory
from bt_tasksim.concept_nodes.grasp_pose import neutral_rotation, resting_place
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import ObjectModel, PlaceModel
from bt_tasksim.planning.reference_motion import plan
from bt_tasksim.planning.ways import Carried, clear_path

HOVERS = (0.03, 0.12)
"""Metres between which the height lies that is taken over from a demonstration."""
LONG_TURN = 2.3
"""Radians of turn from which it matters which way round the hand goes."""


@register("concept")
class Bring(Carry):
    """Carry a held object to a place or a position (keeps free space: NC).

    The object ends ``hover`` above the place (above the rim of a bin), over the place's origin and with its
    heading, up to the object's symmetry. The way goes through ``via`` where it is given; else a straight
    line where that is clear of the fixtures, else a planned path.

    Args:
        target: The held object.
        to: The place, or another object to bring it above.
        position: Where the object's centre ends, robot base frame; instead of ``to``.
        via: Positions of the object's centre on the way, relative to the destination, base-frame axes.
        hover: Free height that remains under the object.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    to: PlaceName | None = None
    position: Position | None = None
    via: Points = ()
    hover: Metres = 0.06
    speed: MetresPerSecond = 0.5
    force_limit: Newtons = FORCE_LIMIT

    contact = ContactChange(ContactState.NC, ContactState.NC)
    presentation = Presentation(
        colour="#b07d22",
        spoken=r"bring|carr(?:y|ies)|mov(?:e|ing)|transport|take .* (?:to|over)\b|over to",
        sayings=("I carry the {} over", "bring it to the {}", "now I move it to the {}"),
        says_destination=True,
    )
    default_timeout = 15.0
    default_tolerance = 0.01

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Where to, and over how many via-points."""
        said = [f"to {parameters['to']}"] if "to" in parameters else []
        if "position" in parameters:
            said.append(f"to {position_words(parameters['position'])}")
        if "via" in parameters:
            count = len(parameters["via"])
            said.append(f"{count} via-point{'' if count == 1 else 's'}" if count else "straight")
        return ", ".join(said)

    @classmethod
    def from_task(cls, task: Task, later: Sequence[Task]) -> dict[str, Any]:
        """Destination and via-points; it ends as high as the place after it began."""
        given = task.parameters
        out: dict[str, Any] = {"target": given["target"]}
        if given.get("to"):
            out["to"] = given["to"]
        else:
            out["position"] = tuple(rounded(v) for v in given["position"])
        out["via"] = rounded_points(given.get("via", ()))
        for other in later:
            if other.concept == "place" and other.parameters["target"] == given["target"]:
                out["hover"] = rounded(np.clip(other.parameters["distance"], *HOVERS))
                break
        return out

    def contradiction(self) -> str:
        """One destination, neither none nor two."""
        return "give either 'to' or 'position'" if (self.to is None) == (self.position is None) else ""

    def begin(self, seen: Seen) -> MoveMemory:
        """Find the way."""
        now, model = seen.object(self.target), seen.model(self.target)
        goal, origin = self._goal(seen, now, model)
        grip = poses.multiply(poses.inverse(now), seen.tool)
        tool_goal = poses.multiply(goal, grip)
        if self.via:
            fractions = np.linspace(0.0, 1.0, len(self.via) + 2)[1:-1]
            middle = [
                poses.multiply(poses.pose(origin + np.asarray(v), poses.interpolate(now, goal, f)[3:]), grip)
                for v, f in zip(self.via, fractions, strict=True)
            ]
            way = [seen.tool, *middle, tool_goal]
        else:
            carried = Carried(seen.robot.envelope, model.extent, poses.inverse(grip))
            way = self._way(seen, tool_goal, carried)
        return MoveMemory(plan(way, self.speed, blend=0.04))

    def _goal(self, seen: Seen, now: Array, model: ObjectModel) -> tuple[Array, Array]:
        """Pose of the object at the end, and the destination's origin that ``via`` refers to."""
        if self.position is not None:
            position = np.asarray(self.position, float)
            return poses.pose(position, now[3:]), position
        assert self.to is not None
        frame, rim = destination(seen, self.to)
        grip = poses.quat_multiply(poses.quat_conjugate(now[3:]), seen.tool[3:])
        approach = poses.z_axis(seen.tool[3:])
        neutral = neutral_rotation(seen, approach, frame[:3])
        easiest = poses.quat_multiply(neutral, poses.quat_conjugate(grip))
        return standing_pose(frame, now, model, rim + self.hover, easiest), frame[:3]

    def _way(self, seen: Seen, goal: Array, carried: Carried) -> list[Array]:
        """Tool poses to the goal; a hand that turns by nearly half a turn goes by its neutral orientation."""
        start, obstacles, exits = seen.tool, seen.world.obstacles, self._exits(seen, goal)
        middle = _by_neutral(seen, start, goal)
        if middle is not None:
            with contextlib.suppress(NoWayError):
                first = clear_path(start, middle, carried, obstacles)
                return [*first[:-1], *clear_path(middle, goal, carried, obstacles)]
        return clear_path(start, goal, carried, obstacles, exits)

    def _exits(self, seen: Seen, tool_goal: Array) -> tuple[Array, Array]:
        """Displacements that take the tool out of what it starts in, and out of where it ends."""
        place = resting_place(seen, self.target) or _place_below(seen, self.target)
        out = np.zeros(3) if place is None else place.clearance * place.exit
        into = np.zeros(3)
        if self.to is not None and self.to in seen.world.places:
            goal = seen.place(self.to)
            into = goal.clearance * goal.exit
            if goal.kind == "bin":
                into = np.zeros(3)
        return out, into


def _by_neutral(seen: Seen, start: Array, goal: Array) -> Array | None:
    """The pose half way where the shortest turn would lead the hand round by its hindmost orientation.

    Turned by nearly half a turn, the shorter way may be the one that the arm cannot go: then this is the
    middle of the other one. None where the shortest turn is good.
    """
    if float(poses.angle_between(start[3:], goal[3:])) < LONG_TURN:
        return None
    middle = poses.interpolate(start, goal, 0.5)
    approach = poses.z_axis(middle[3:])
    neutral = neutral_rotation(seen, approach, middle[:3])
    if float(poses.angle_between(neutral, middle[3:])) <= np.pi / 2:
        return None
    return poses.pose(middle[:3], poses.quat_multiply(middle[3:], np.array([0.0, 0.0, 0.0, 1.0])))


def destination(seen: Seen, name: str) -> tuple[Array, float]:
    """Frame ``(7,)`` of a place or ``(..., 7)`` of the top of an object, and its rim's height in metres."""
    if name in seen.world.places:
        place = seen.place(name)
        return place.pose, (place.height if place.kind == "bin" else 0.0)
    below, model = seen.object(name), seen.model(name)
    return below + poses.constant([0, 0, model.extent[2] / 2, 0, 0, 0, 0], below), 0.0


def standing_pose(
    frame: Array, now: Array, model: ObjectModel, height: float, towards: Array | None = None
) -> Array:
    """Pose ``(..., 7)`` of an object that stands above a frame, turned as its symmetry allows.

    Args:
        frame: Pose ``(..., 7)`` of the place.
        now: Present pose ``(..., 7)`` of the object.
        model: The object.
        height: Free height below it, metres.
        towards: Rotation ``(..., 4)`` of the object that is preferred; by default the present one.
    """
    towards = now[..., 3:] if towards is None else towards
    frame = poses.constant(frame, now)
    half = (max(model.extent) if model.cubic else model.extent[2]) / 2
    position = poses.transform(frame, poses.constant([0.0, 0.0, height + half], now))
    if model.symmetry == 0 and not model.cubic:
        best = _upright(frame, now)
    else:
        turns = (
            _CUBE
            if model.cubic
            else [poses.yaw(2 * np.pi * k / model.symmetry) for k in range(model.symmetry)]
        )
        ways = [poses.quat_multiply(frame[..., 3:], poses.constant(q, now)) for q in turns]
        best = _nearest_rotation(ways, towards)
    xp = array_namespace(now)
    batch = now.shape[:-1]
    return xp.concat([xp.broadcast_to(position, (*batch, 3)), xp.broadcast_to(best, (*batch, 4))], axis=-1)


def _upright(frame: Array, now: Array) -> Array:
    """The rotations ``(..., 4)`` that set the z axis upright on a frame by the shortest turn."""
    xp = array_namespace(now)
    z = poses.constant([0.0, 0.0, 1.0], now)
    up, should = poses.rotate(now[..., 3:], z), poses.rotate(frame[..., 3:], z)
    axis = poses.cross(up, should)
    length = xp.sqrt(xp.sum(axis * axis, axis=-1, keepdims=True))
    angle = xp.atan2(length, xp.sum(up * should, axis=-1, keepdims=True))
    small = length <= 1e-9
    tilt = axis * xp.where(
        small, xp.zeros_like(length), angle / xp.where(small, xp.ones_like(length), length)
    )
    return poses.quat_multiply(poses.from_rotation_vector(tilt), now[..., 3:])


def _nearest_rotation(ways: list[Array], towards: Array) -> Array:
    """Of rotations ``(..., 4)`` the one that is the shortest turn away; of equal ones the first."""
    if len(ways) == 1:
        return ways[0]
    xp = array_namespace(towards)
    # Alike as rotations where q and -q are: the larger |q . r|, the shorter the turn.
    nearness = xp.stack([xp.abs(xp.sum(q * towards, axis=-1)) for q in ways], axis=-1)
    first = xp.argmax(xp.round(nearness * 1e9), axis=-1)
    best = ways[0]
    for k in range(1, len(ways)):
        best = xp.where((first == k)[..., None], ways[k], best)
    return best


def _place_below(seen: Seen, target: str) -> PlaceModel | None:
    """The place of a fixture above which a lifted object is, where that fixture would be in its way out."""
    pose = seen.object(target)
    best: tuple[float, PlaceModel] | None = None
    for place in seen.world.places.values():
        local = poses.transform(poses.inverse(place.pose), pose[:3])
        inside = all(abs(float(local[i]) - place.centre[i]) <= place.extent[i] / 2 for i in range(2))
        if inside and 0.0 < float(local[2]) < min(place.height, 0.4) and (best is None or local[2] < best[0]):
            best = (float(local[2]), place)
    return best[1] if best else None


def _cube_rotations() -> list[Array]:
    quarter = [poses.yaw(k * np.pi / 2) for k in range(4)]
    tips = [np.array([1.0, 0.0, 0.0, 0.0])]
    for axis in (0, 1):
        for angle in (np.pi / 2, np.pi, -np.pi / 2) if axis == 0 else (np.pi / 2, -np.pi / 2):
            v = np.zeros(3)
            v[axis] = angle
            tips.append(poses.from_rotation_vector(v))
    return [poses.quat_multiply(q, t) for t in tips for q in quarter]


_CUBE = _cube_rotations()
