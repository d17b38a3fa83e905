"""Where the tool has to be to grasp an object, from what is known of the object and of what it stands on."""

from __future__ import annotations

import math
from typing import NamedTuple

from bt_tasksim.concept.functions import zeros
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core import poses
from bt_tasksim.core.fact_arrays import ObjectFacts, PlaceFacts, take_rows
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.robot.kinematics.hand import depth_at, standing_side

DOWN = (0.0, 0.0, -1.0)
UNSUPPORTED = 0.006
"""Metres less deep that a hand reaches to what stands on no known place, whose height is an estimate
alone."""
ON_TOP = 0.02
"""Metres between the bottom of an object and the top of another one within which it stands on that."""
_SAME = 1e-9
"""Cost by which a candidate has to be better than one before it."""
_WORST = 1e9


class FoundPlace(NamedTuple):
    """A place in each world, where there is one.

    Attributes:
        found: Boolean ``(N,)``.
        place: The places ``(N,)``; of no meaning where none was found.
    """

    found: Array
    place: PlaceFacts


def resting_place(seen: Seen, target: str) -> FoundPlace:
    """The place on which an object seems to stand, if it stands on any."""
    half = seen.model(target).extent[:, 2] / 2
    local = _in_places(seen, target)
    gap = abs(local[..., 2] - half[:, None])
    return nearest_place(seen, _above(seen, local, 0.02) & (gap < 0.05), gap)


def on_object(seen: Seen, target: str) -> Array:
    """Boolean ``(N,)``: an object seems to stand on another one, whose top is nearer than any place below."""
    pose, model, facts = seen.object(target), seen.model(target), seen.world.object_facts
    xp = array_namespace(pose)
    others = seen.objects
    bottom = pose[:, 2] - model.extent[:, 2] / 2
    tops = others[..., 2] + facts.extent[..., 2] / 2
    aside = poses.norm(others[..., :2] - pose[:, None, :2])
    over = aside < xp.max(facts.extent[..., :2], axis=-1) / 2
    near = xp.abs(bottom[:, None] - tops) < ON_TOP
    higher = others[..., 2] < pose[:, None, 2] - ON_TOP  # not itself, and nothing beside it
    found = over & near & higher & facts.present
    return xp.any(found, axis=-1)


def place_below(seen: Seen, target: str, highest: float = 0.4) -> FoundPlace:
    """The place of a fixture above which a lifted object is, where that fixture would be in its way out."""
    local = _in_places(seen, target)
    height, room = local[..., 2], poses.clip(seen.world.place_facts.height, -math.inf, highest)
    return nearest_place(seen, _above(seen, local, 0.0) & (height > 0.0) & (height < room), height)


def _in_places(seen: Seen, target: str) -> Array:
    """Positions ``(N, n_places, 3)`` of an object in the frames of all places."""
    return poses.localise(seen.world.place_facts.pose, seen.object(target)[:, None, :3])


def _above(seen: Seen, local: Array, margin: float) -> Array:
    """Boolean ``(N, n_places)``: a position is above the surface, up to a margin in metres."""
    places = seen.world.place_facts
    xp = array_namespace(local)
    beside = xp.abs(local[..., :2] - places.centre) <= places.extent / 2 + margin
    return xp.all(beside, axis=-1) & places.present


def nearest_place(seen: Seen, fits: Array, gap: Array) -> FoundPlace:
    """Of the places that fit, booleans ``(N, n_places)``, the first of its world with the smallest gap."""
    xp = array_namespace(gap)
    if not gap.shape[1]:
        return FoundPlace(xp.zeros(gap.shape[:1], dtype=xp.bool, device=gap.device), _nowhere(gap))
    cost = xp.where(fits, gap, xp.full_like(gap, _WORST))
    rank = xp.astype(seen.world.place_facts.rank, cost.dtype)
    good = cost <= xp.min(cost, axis=1, keepdims=True) + 1e-6
    best = xp.argmin(xp.where(good & fits, rank, xp.full_like(cost, _WORST)), axis=1)
    return FoundPlace(xp.any(fits, axis=-1), seen.world.place_at(best))


def _nowhere(like: Array) -> PlaceFacts:
    """A place in each world, where there are none at all."""
    xp, n = array_namespace(like), like.shape[0]
    none = xp.zeros((n,), dtype=like.dtype, device=like.device)
    up = none[:, None] + constant([0.0, 0.0, 1.0], like)
    pose = none[:, None] + constant([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], like)
    flags = xp.zeros((n,), dtype=xp.bool, device=like.device)
    return PlaceFacts(flags, pose, up[:, :2], up[:, :2], none, up, up, none, flags, none, flags)


def grasp_pose(
    seen: Seen,
    target: str,
    approach: tuple[float, float, float] | None = None,
    closing: tuple[float, float, float] | None = None,
) -> Array:
    """The tool poses ``(N, 7)`` for a grasp of an object at its estimated pose.

    Of the object's grasp axes those count that lie across the approach and fit into the hand; of the tool
    orientations that they leave, the one nearest to the hand's neutral one there is taken.
    """
    pose, model = seen.object(target), seen.model(target)
    a = _approach(seen, target, approach)
    neutral = neutral_rotation(seen, a, pose[:, :3])
    axes, rank, counts = _closing_axes(seen, pose, model, a, neutral, closing)
    xp = array_namespace(pose)
    both = xp.reshape(xp.stack([axes, -axes], axis=2), (axes.shape[0], -1, 3))  # each one both ways round
    rotations = poses.frame_from_axes(xp.broadcast_to(a[:, None, :], both.shape), both)
    cost = poses.angle_between(neutral[:, None, :], rotations) + 0.3 * xp.repeat(rank, 2, axis=1)
    best = _first_best(xp.where(xp.repeat(counts, 2, axis=1), cost, xp.full_like(cost, _WORST)), _SAME)
    reach = half_extent(pose, model, a)
    stands = resting_place(seen, target).found & ~on_object(seen, target)
    less = xp.where(stands, xp.zeros_like(reach), xp.full_like(reach, UNSUPPORTED))
    rotation = take_rows(rotations, best)
    y = poses.rotate(rotation, constant([0.0, 1.0, 0.0], pose))
    half = half_extent(pose, model, y)
    depth = depth_at(seen.robot, 2.0 * half)
    position = pose[:, :3] - poses.clip(reach - (depth - less), 0.0, math.inf)[:, None] * a
    side = standing_side(seen.robot)
    if side is not None:
        position = position - beside_standing(side, half)[:, None] * y
    return xp.concat([position, rotation], axis=-1)


def beside_standing(side: float, half_width: Array) -> Array:
    """How far ``(N,)`` along the tool's y axis the middle of an object belongs, metres.

    Args:
        side: Where its face belongs, see `standing_side`.
        half_width: Half of its width ``(N,)``.
    """
    return side - math.copysign(1.0, side) * half_width


def _approach(seen: Seen, target: str, given: tuple[float, float, float] | None) -> Array:
    """Unit vectors ``(N, 3)`` along which the tool comes."""
    pose = seen.object(target)
    if given is not None:
        return zeros(pose, 3) + constant(given, pose)
    stands = resting_place(seen, target)
    xp = array_namespace(pose)
    return xp.where(stands.found[:, None], stands.place.access, constant(DOWN, pose))


def neutral_rotation(seen: Seen, approach: Array, position: Array) -> Array:
    """The tool orientation ``(N, 4)`` in which the arm is farthest from its joints' limits.

    It is the one that the closing axis of the rest posture has when the arm's base turns to ``position``.

    Args:
        seen: What is seen.
        approach: Unit vectors ``(N, 3)`` along which the tool comes, robot base frame.
        position: Where the tool is going to be, ``(N, 3)`` metres.
    """
    xp = array_namespace(position)
    half = xp.atan2(position[:, 1], position[:, 0]) / 2
    zero = xp.zeros_like(half)
    heading = xp.stack([xp.cos(half), zero, zero, xp.sin(half)], axis=-1)
    return poses.frame_from_axes(approach, poses.rotate(heading, constant(seen.robot.closing, position)))


def _closing_axes(
    seen: Seen,
    pose: Array,
    model: ObjectFacts,
    approach: Array,
    neutral: Array,
    closing: tuple[float, float, float] | None,
) -> tuple[Array, Array, Array]:
    """Candidate axes ``(N, n, 3)``, their ranks ``(N, n)``, and booleans ``(N, n)``: it counts."""
    xp = array_namespace(pose)
    one = xp.ones_like(pose[:, :1])
    if closing is not None:
        return poses.rotate(pose[:, 3:], constant(closing, pose))[:, None, :], 0.0 * one, one > 0.0
    axes = poses.rotate(pose[:, None, 3:], model.grasp_axes)
    across = abs(poses.dot(axes, approach[:, None, :])) < 0.5
    counts = across & (model.grasp_widths < seen.world.opening - 0.006) & ~model.revolved[:, None]
    numbers = xp.astype(counts, pose.dtype)
    rank = xp.stack([xp.sum(numbers[:, :k], axis=1) for k in range(axes.shape[1])], axis=1)
    otherwise = xp.where(
        model.revolved[:, None],
        _across_revolved(pose, approach, neutral),
        _across_anything(pose, approach),
    )
    none = ~xp.any(counts, axis=1)[:, None]
    # Those that do not count may lie along the approach, across which nothing can be said of them.
    axes = xp.where(counts[..., None], axes, otherwise[:, None, :])
    return (
        xp.concat([axes, otherwise[:, None, :]], axis=1),
        xp.concat([rank, 0.0 * one], axis=1),
        xp.concat([counts, none], axis=1),
    )


def _across_revolved(pose: Array, approach: Array, neutral: Array) -> Array:
    """Axes ``(N, 3)`` to close along on a body of revolution.

    Along its axis any direction across it will do, and the hand's neutral one is taken; from the side it is
    the one across the object's axis and the approach.
    """
    xp = array_namespace(pose)
    upright = poses.z_axis(pose[:, 3:])
    tool_y = poses.rotate(neutral, constant([0.0, 1.0, 0.0], pose))
    from_above = tool_y - poses.dot(tool_y, approach)[:, None] * approach
    from_side = poses.cross(upright, approach)
    along = (abs(poses.dot(upright, approach)) > 0.7)[:, None]
    return _safe_unit(xp.where(along, from_above, from_side), tool_y)


def _across_anything(pose: Array, approach: Array) -> Array:
    """Axes ``(N, 3)`` to close along where none of the known ones will do."""
    xp = array_namespace(pose)
    upright = poses.z_axis(pose[:, 3:])
    along = (abs(poses.dot(upright, approach)) < 0.9)[:, None]
    return _safe_unit(poses.cross(approach, xp.where(along, upright, pose[:, :3])), upright)


def _safe_unit(v: Array, otherwise: Array) -> Array:
    """Vectors ``(N, 3)`` scaled to unit length; other ones where they have none."""
    xp = array_namespace(v)
    return poses.unit(xp.where((poses.norm(v) > 1e-9)[:, None], v, otherwise))


def _first_best(cost: Array, slack: float) -> Array:
    """Index ``(N,)`` of the first one that costs as little as any other of its row, up to a slack."""
    xp = array_namespace(cost)
    good = cost <= xp.min(cost, axis=1, keepdims=True) + slack
    return xp.argmax(xp.astype(good, xp.int64), axis=1)


def half_extent(pose: Array, model: ObjectFacts, direction: Array) -> Array:
    """Half the size ``(N,)`` of an object's bounding box along a direction ``(N, 3)``, metres."""
    xp = array_namespace(pose)
    local = abs(poses.rotate(poses.quat_conjugate(pose[:, 3:]), direction))
    radial = poses.norm(local[:, :2])
    round_size = radial * model.extent[:, 0] + local[:, 2] * model.extent[:, 2]
    return xp.where(model.revolved, round_size, poses.dot(local, model.extent)) / 2
