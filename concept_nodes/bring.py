"""Bring: carry a held object through free space to a place, clear of everything on the way."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bt_tasksim.concept.contact import ContactChange, ContactState
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
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes.carry import Carry, MoveMemory
from bt_tasksim.concept_nodes.grasp_pose import neutral_rotation, place_below, resting_place
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.fact_arrays import ObjectFacts, take_rows
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.transfer import fetched
from bt_tasksim.core.world import Obstacle
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
        now = seen.object(self.target)
        goal, origin = self._goal(seen, now)
        grip = poses.relative(now, seen.tool)
        tool_goal = poses.multiply(goal, grip)
        if self.via:
            way = [seen.tool, *self._via(now, goal, origin, grip), tool_goal]
        else:
            way = self._ways(seen, tool_goal, grip)
        return MoveMemory(plan(way, self.speed, blend=0.04))

    def _goal(self, seen: Seen, now: Array) -> tuple[Array, Array]:
        """Poses ``(N, 7)`` of the object at the end, and the destination's origin that ``via`` refers to."""
        xp = array_namespace(now)
        if self.position is not None:
            origin = xp.zeros_like(now[:, :3]) + constant(self.position, now)
            return xp.concat([origin, now[:, 3:]], axis=-1), origin
        assert self.to is not None
        frame, rim = destination(seen, self.to)
        grip = poses.quat_multiply(poses.quat_conjugate(now[:, 3:]), seen.tool[:, 3:])
        neutral = neutral_rotation(seen, poses.z_axis(seen.tool[:, 3:]), frame[:, :3])
        easiest = poses.quat_multiply(neutral, poses.quat_conjugate(grip))
        goal = standing_pose(frame, now, seen.model(self.target), rim + self.hover, easiest)
        return goal, frame[:, :3]

    def _via(self, now: Array, goal: Array, origin: Array, grip: Array) -> list[Array]:
        """Tool poses at the via-points, turned evenly from one to the next."""
        xp, out = array_namespace(now), []
        for k, via in enumerate(self.via):
            share = xp.zeros_like(now[:, 0]) + (k + 1) / (len(self.via) + 1)
            turned = poses.interpolate(now, goal, share)[:, 3:]
            out.append(poses.multiply(xp.concat([origin + constant(via, now), turned], axis=-1), grip))
        return out

    def _ways(self, seen: Seen, tool_goal: Array, grip: Array) -> list[Array]:
        """Tool poses ``(N, 7)`` to the goal, searched for in one world after the other.

        Raises:
            NoWayError: There is none in one of them.
        """
        extent = seen.model(self.target).extent
        middle, turns = _by_neutral(seen, tool_goal)
        held, exits = poses.inverse(grip), self._exits(seen)
        arrays = (seen.tool, tool_goal, middle, held, extent, *exits)
        start, goal, middle, held, extent, out, into = fetched(arrays)
        ways, obstacles = [], obstacles_of(seen)
        for k in range(goal.shape[0]):
            carried = Carried(seen.robot.envelope, tuple(extent[k].tolist()), held[k])
            turn = middle[k] if bool(turns[k]) else None
            ways.append(_way(start[k], goal[k], turn, carried, obstacles[k], (out[k], into[k])))
        most = max(len(way) for way in ways)
        padded = np.array([[*way, *[way[-1]] * (most - len(way))] for way in ways])
        return [constant(padded[:, k], tool_goal) for k in range(most)]

    def _exits(self, seen: Seen) -> tuple[Array, Array]:
        """Displacements ``(N, 3)`` that take the tool out of what it starts in, and out of where it ends."""
        xp = array_namespace(seen.tool)
        stands, below = resting_place(seen, self.target), place_below(seen, self.target)
        nothing = xp.zeros_like(seen.tool[:, :3])
        out = xp.where(below.found[:, None], below.place.clearance[:, None] * below.place.exit, nothing)
        out = xp.where(stands.found[:, None], stands.place.clearance[:, None] * stands.place.exit, out)
        if self.to is None or self.to not in seen.world.place_columns:
            return out, nothing
        goal = seen.place(self.to)
        return out, xp.where(goal.container[:, None], nothing, goal.clearance[:, None] * goal.exit)


def obstacles_of(seen: Seen) -> list[list[Obstacle]]:
    """What is to be kept clear of in each world."""
    boxes = seen.world.obstacle_facts
    there, pose, size = fetched([boxes.present, boxes.pose, boxes.size])
    return [
        [Obstacle(at[k], tuple(full[k].tolist()), "") for k in np.flatnonzero(has).tolist()]
        for has, at, full in zip(there, pose, size, strict=True)
    ]


def _way(
    start: Array,
    goal: Array,
    turn: Array | None,
    carried: Carried,
    obstacles: list[Obstacle],
    exits: tuple[Array, Array],
) -> list[Array]:
    """Tool poses ``(7,)`` to a goal in one world.

    Args:
        start: Where the tool is.
        goal: Where it should be.
        turn: A pose on the way where it should turn by, or None.
        carried: What moves with the tool.
        obstacles: What to keep clear of.
        exits: See `bt_tasksim.planning.ways.clear_path`.
    """
    if turn is not None:
        with contextlib.suppress(NoWayError):
            first = clear_path(start, turn, carried, obstacles)
            return [*first[:-1], *clear_path(turn, goal, carried, obstacles)]
    return clear_path(start, goal, carried, obstacles, exits)


def _by_neutral(seen: Seen, goal: Array) -> tuple[Array, Array]:
    """The poses ``(N, 7)`` half way of the longer turn, and booleans ``(N,)``: it is the one to take.

    Turned by nearly half a turn, the shorter way may be the one that the arm cannot go, since it leads the
    hand round by its hindmost orientation.
    """
    start = seen.tool
    xp = array_namespace(start)
    far = poses.angle_between(start[:, 3:], goal[:, 3:]) >= LONG_TURN
    middle = poses.interpolate(start, goal, 0.5 + xp.zeros_like(start[:, 0]))
    neutral = neutral_rotation(seen, poses.z_axis(middle[:, 3:]), middle[:, :3])
    hindmost = poses.angle_between(neutral, middle[:, 3:]) > math.pi / 2
    turned = poses.quat_multiply(middle[:, 3:], constant([0.0, 0.0, 0.0, 1.0], middle))
    return xp.concat([middle[:, :3], turned], axis=-1), far & hindmost


def destination(seen: Seen, name: str) -> tuple[Array, Array]:
    """Frames ``(N, 7)`` of a place or of the top of an object, and their rims' heights ``(N,)`` in metres."""
    if name in seen.world.place_columns:
        place = seen.place(name)
        return place.pose, place.rim
    below, height = seen.object(name), seen.model(name).extent[:, 2] / 2
    xp = array_namespace(below)
    nothing = xp.zeros_like(height)
    return poses.shifted(below, xp.stack([nothing, nothing, height], axis=-1)), nothing


def standing_pose(
    frame: Array, now: Array, model: ObjectFacts, height: Array | float = 0.0, towards: Array | None = None
) -> Array:
    """Poses ``(N, 7)`` of an object that stands above a frame, turned as its symmetry allows.

    Args:
        frame: Poses ``(N, 7)`` of the place.
        now: Present poses ``(N, 7)`` of the object.
        model: The object.
        height: Free height below it, metres, one for all or ``(N,)``.
        towards: Rotations ``(N, 4)`` of the object that are preferred; by default the present ones.
    """
    towards = now[:, 3:] if towards is None else towards
    xp = array_namespace(now)
    centre = model.standing_height + height
    nothing = xp.zeros_like(centre)
    position = poses.transform(frame, xp.stack([nothing, nothing, centre], axis=-1))
    nearest = _nearest_rotation(frame[:, 3:], model, towards)
    best = xp.where(model.revolved[:, None], _upright(frame, now), nearest)
    return xp.concat([position, best], axis=-1)


def _upright(frame: Array, now: Array) -> Array:
    """The rotations ``(N, 4)`` that set the z axis upright on a frame by the shortest turn."""
    xp = array_namespace(now)
    up, should = poses.z_axis(now[:, 3:]), poses.z_axis(frame[:, 3:])
    axis = poses.cross(up, should)
    length = poses.norm(axis)
    small = length <= 1e-9
    angle = xp.atan2(length, poses.dot(up, should)) / xp.where(small, xp.ones_like(length), length)
    tilt = axis * xp.where(small, xp.zeros_like(length), angle)[:, None]
    return poses.quat_multiply(poses.from_rotation_vector(tilt), now[:, 3:])


def _nearest_rotation(frame: Array, model: ObjectFacts, towards: Array) -> Array:
    """Of the rotations ``(N, 4)`` in which an object looks the same, the one that is the shortest turn away.

    Of equal ones it is the first.
    """
    xp = array_namespace(towards)
    ways = poses.quat_multiply(frame[:, None, :], model.rotations)
    # Alike as rotations where q and -q are: the larger |q . r|, the shorter the turn.
    nearness = abs(poses.dot(ways, towards[:, None, :]))
    counts = xp.where(model.rotation_counts, xp.round(nearness * 1e9), -xp.ones_like(nearness))
    return take_rows(ways, xp.argmax(counts, axis=1))
