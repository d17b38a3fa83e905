"""Where on a surface a thing comes to stand, and how near to another one: laws over arrays of worlds."""

from __future__ import annotations

import math

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.grasp_pose import FoundPlace, half_extent, nearest_place
from bt_tasksim.core import poses
from bt_tasksim.core.fact_arrays import ObjectFacts, take_rows
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.scene.specs import Goal

NEAR = Goal.distance
"""Metres between two objects up to which one stands beside the other."""


def edges(seen: Seen, name: str) -> tuple[Array, Array]:
    """Centres ``(N, 2)`` and half sizes ``(N, 2)`` of a place, or of an object's top, in its own frame."""
    if name in seen.world.place_columns:
        place = seen.place(name)
        return place.centre, place.extent / 2
    half = seen.model(name).extent[:, :2] / 2
    return array_namespace(half).zeros_like(half), half


def carrying(seen: Seen, target: str) -> FoundPlace:
    """The highest place below an object's middle of which something would carry it, if there is one."""
    places, now = seen.world.place_facts, seen.object(target)
    local = poses.localise(places.pose, now[:, None, :3])
    over = array_namespace(now).all(abs(local[..., :2] - places.centre) <= places.extent / 2, axis=-1)
    height = local[..., 2]
    below = over & (height > 0.0) & (height < places.height)
    return nearest_place(seen, below & places.present & places.carries, height)


def straight_down(
    frame: Array, now: Array, model: ObjectFacts, rectangle: tuple[Array, Array] | None = None
) -> Array:
    """Poses ``(N, 7)`` of objects that stand upright on a surface, right below where they are.

    Args:
        frame: Poses ``(N, 7)`` of the surfaces.
        now: Poses ``(N, 7)`` of the objects.
        model: The objects.
        rectangle: Middle ``(N, 2)`` and half size ``(N, 2)`` of a part of the surface, in its frame: who is
            beyond it comes to stand on its edge.
    """
    xp = array_namespace(now)
    flat = poses.localise(frame, now[:, :3])[:, :2]
    if rectangle is not None:
        centre, half = rectangle
        flat = xp.minimum(xp.maximum(flat, centre - half), centre + half)
    position = poses.transform(frame, xp.concat([flat, model.standing_height[:, None]], axis=-1))
    return xp.concat([position, upright(frame, now, model.cubic)], axis=-1)


def upright(frame: Array, now: Array, cubic: Array | None = None) -> Array:
    """The rotations ``(N, 4)`` that set objects upright on surfaces by the shortest turn.

    What is upside down is turned about its own x axis.

    Args:
        frame: Poses ``(N, 7)`` of the surfaces.
        now: Poses ``(N, 7)`` of the objects.
        cubic: Booleans ``(N,)``: of these any face may be down; by default none.
    """
    xp = array_namespace(now)
    up, should = poses.z_axis(now[:, 3:]), poses.z_axis(frame[:, 3:])
    if cubic is not None:
        up = xp.where(cubic[:, None], _highest_axis(now, should), up)
    tilt = poses.shortest_turn(up, should, poses.rotate(now[:, 3:], constant([1.0, 0.0, 0.0], now)))
    return poses.quat_multiply(poses.from_rotation_vector(tilt), now[:, 3:])


def _highest_axis(now: Array, up: Array) -> Array:
    """Of the axes of objects, both ways, the one ``(N, 3)`` that points most nearly along ``up (N, 3)``."""
    xp = array_namespace(now)
    axes = xp.stack([poses.rotate(now[:, 3:], constant(axis, now)) for axis in _AXES], axis=1)
    return take_rows(axes, xp.argmax(xp.round(poses.dot(axes, up[:, None, :]) * 1e9), axis=1))


_AXES = tuple(
    tuple(sign if k == axis else 0.0 for k in range(3)) for axis in (2, 0, 1) for sign in (1.0, -1.0)
)


def top_frame(pose: Array, height: Array) -> Array:
    """Level frames ``(N, 7)`` on top of objects that stand, turned as they are; a cube may lie on any face.

    Args:
        pose: Poses ``(N, 7)`` of the objects.
        height: Metres ``(N,)`` from their middles up to their tops.
    """
    xp = array_namespace(pose)
    half, nothing = 0.5 * heading_of(pose), xp.zeros_like(height)
    turn = xp.stack([xp.cos(half), nothing, nothing, xp.sin(half)], axis=-1)
    return xp.concat([pose[:, :2], (pose[:, 2] + height)[:, None], turn], axis=-1)


def heading_of(pose: Array) -> Array:
    """Headings ``(N,)`` in radians of objects that stand: of their x axis, or y where that is flatter."""
    xp = array_namespace(pose)
    x, y = (poses.rotate(pose[:, 3:], constant(axis, pose)) for axis in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    flat = abs(x[:, 2]) <= abs(y[:, 2])
    along = xp.where(flat[:, None], x, y)
    found = xp.atan2(along[:, 1], along[:, 0])
    return found - xp.where(flat, xp.zeros_like(found), xp.full_like(found, math.pi / 2))


def level_of(seen: Seen, other: str) -> Array:
    """Frames ``(N, 7)`` of the level surfaces on which an object stands, right below its middle."""
    pose = seen.object(other)
    xp = array_namespace(pose)
    up = xp.zeros_like(pose[:, :3]) + constant([0.0, 0.0, 1.0], pose)
    floor = pose[:, 2] - half_extent(pose, seen.model(other), up)
    level = xp.zeros_like(pose[:, 3:]) + constant([1.0, 0.0, 0.0, 0.0], pose)
    return xp.concat([pose[:, :2], floor[:, None], level], axis=-1)


def apart(seen: Seen, target: str, other: str) -> tuple[Array, Array]:
    """Free room ``(N,)`` between two objects along the line of their middles, and how much higher one is.

    Both are in metres and those of the boxes about the objects; negative where these overlap.
    """
    now, there = seen.object(target), seen.object(other)
    xp = array_namespace(now)
    nothing = xp.zeros_like(now[:, :1])
    across = xp.concat([now[:, :2] - there[:, :2], nothing], axis=-1)
    distance = poses.norm(across)
    along = across / xp.maximum(distance, nothing[:, 0] + 1e-9)[:, None]
    up = xp.zeros_like(across) + constant([0.0, 0.0, 1.0], now)
    mine, theirs = seen.model(target), seen.model(other)
    gap = distance - half_extent(now, mine, along) - half_extent(there, theirs, along)
    return gap, now[:, 2] - half_extent(now, mine, up) - level_of(seen, other)[:, 2]
