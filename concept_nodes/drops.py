"""Where an object may fall into a container, in one world, so that what is in there stays low.

What falls on other things may come to rest with its middle above the rim, or roll over it. So it is let go
where it falls on the floor, or else on what is lowest; where more is to come, where that finds room, too; and
else over the middle, far from the walls.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bt_tasksim.concept_nodes.spots import corners_of, outline_of, surface_of
from bt_tasksim.concept_nodes.standing import (
    headings,
    nearest_first,
    reference_frame,
    standing_height,
    standing_options,
)
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import PlaceModel
from bt_tasksim.planning.room import Room
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.scene.outlines import hull

WALL = 0.008
"""Metres from the walls, where the container is large enough for that: hands open unevenly."""
ROUND = 0.6
"""Share of its larger side from above that something keeps from the walls, too: it may turn as it falls."""
BY = 0.004
"""Metres between two outlines from which on one thing falls beside the other."""
FAR = 0.03
"""Metres between two outlines beyond which more of them is no better."""
STEP = 0.01
"""Metres of height, and of room, that make a difference."""
GRID = np.stack(np.meshgrid([0.0, -1.0, 1.0], [0.0, -1.0, 1.0], indexing="ij"), axis=-1).reshape(-1, 2)
"""Where in a container things are let go: shares of the way from its middle to its walls."""
LATER = (0.0, np.pi / 2)
"""Headings along the walls in which room is sought for what is to come."""


class _Lying(NamedTuple):
    """Something in a container.

    Attributes:
        outline: Corners ``(n, 2)`` of its outline, in the container's frame, metres.
        top: Metres above the floor to which it reaches.
    """

    outline: Array
    top: float


def preferred_options(
    view: WorldView, target: str, reference: str, hover: float = 0.0, later: Sequence[str] = ()
) -> Array:
    """Poses ``(k, 7)`` of an object over a place or another object, in the order in which they are preferred.

    Over a container see `drops`; elsewhere those of `standing_options`, the least turned first.

    Args:
        view: The world.
        target: The object.
        reference: The place, or the other object.
        hover: Free height below it, metres; over a container, above its rim.
        later: Objects that are put there, too, after this one.
    """
    place, now = view.world.places.get(reference), view.objects[target][3:]
    if place is None or place.kind != "bin":
        return nearest_first(standing_options(view, target, reference, hover), now)
    return drops(view, target, place, hover, later)


def drops(view: WorldView, target: str, place: PlaceModel, hover: float, later: Sequence[str] = ()) -> Array:
    """Poses ``(k, 7)`` over a container in which an object may be let go, the best first.

    Args:
        view: The world.
        target: The object.
        place: The container.
        hover: Metres above its rim.
        later: Objects that are to fall into it after this one.
    """
    frame, rim = reference_frame(view, place.name)
    model, now = view.model(target), view.objects[target][3:]
    height = standing_height(model) + hover + rim
    turns = headings()
    outlines, offsets = [], []
    for turn in turns:
        outlines.append(_outline(view, target, turn))
        offsets.append(_offsets(place, outlines[-1], ROUND * max(model.extent[:2])))
    points, count = np.concatenate(offsets), len(GRID)
    there = _lying(view, target, place)
    falls = np.concatenate([_falls(o, p, there) for o, p in zip(outlines, offsets, strict=True)])
    rooms = _rooms(view, place, outlines, offsets, there, [n for n in later if n in view.objects])
    rotations = poses.quat_multiply(frame[None, 3:], np.repeat(turns, count, axis=0))
    angles = np.round(poses.angle_between(rotations, now[None]), 6)
    middle = np.round(np.linalg.norm(points - np.asarray(place.centre), axis=-1), 6)
    order = np.lexsort([middle, angles, -falls[:, 1], -rooms, falls[:, 0]])
    positions = poses.transform(frame, np.column_stack([points, np.full(len(points), height)]))
    found: Array = np.concatenate([positions, rotations], axis=-1)[order]
    return found


def _outline(view: WorldView, name: str, turn: Array) -> Array:
    """Corners ``(n, 2)`` of an object's outline about its middle, as it stands turned by ``(4,)``."""
    pieces = np.concatenate(pieces_of(view.model(name)))
    return hull(poses.rotate(turn[None], pieces)[:, :2])


def _offsets(place: PlaceModel, outline: Array, round_: float) -> Array:
    """Points ``(9, 2)`` in a container's frame where an outline about its origin is within the walls."""
    middle, half = np.asarray(place.centre), np.asarray(place.extent) / 2
    room = half - np.maximum(np.abs(outline).max(axis=0) + WALL, round_)
    found: Array = middle + np.maximum(room, 0.0) * GRID
    return found


def _lying(view: WorldView, target: str, place: PlaceModel) -> list[_Lying]:
    """What is in a container, and the spots that are marked in it: something else is to stand there."""
    frame, middle, half = np.asarray(place.pose), np.asarray(place.centre), np.asarray(place.extent) / 2

    def there(point: Array) -> bool:
        return bool((abs(poses.localise(frame, point)[:2] - middle) < half).all())

    found = []
    for name, pose in view.objects.items():
        if name != target and np.isfinite(pose).all() and there(pose[:3]):
            corners = poses.localise(frame, corners_of(view, name))
            found.append(_Lying(hull(corners[:, :2]), float(corners[:, 2].max())))
    for name, spot in view.world.places.items():
        if spot.kind == "spot" and there(np.asarray(spot.pose)[:3]):
            edges = outline_of(surface_of(view, name))
            flat = np.column_stack([edges, np.full(len(edges), spot.pose[2])])
            found.append(_Lying(hull(poses.localise(frame, flat)[:, :2]), place.height))
    return found


def _falls(outline: Array, points: Array, there: Sequence[_Lying]) -> Array:
    """On what an outline at ``points (k, 2)`` falls, and its gap to what it does not fall on ``(k, 2)``.

    Both in metres and in steps of `STEP`; on the floor it is 0.
    """
    on, gap = np.zeros(len(points)), np.full(len(points), FAR)
    for each in there:
        apart = Room(outline, [each.outline]).gaps(points)
        on = np.where(apart < BY, np.maximum(on, each.top), on)
        gap = np.minimum(gap, np.maximum(apart, 0.0))
    return STEP * np.stack([np.ceil(on / STEP - 1e-6), np.round(gap / STEP)], axis=-1)


def _rooms(
    view: WorldView,
    place: PlaceModel,
    outlines: Sequence[Array],
    offsets: Sequence[Array],
    there: Sequence[_Lying],
    later: Sequence[str],
) -> Array:
    """How many of some objects would find the floor beside outlines ``(n * 9,)`` that are in a container."""
    found = np.zeros((len(outlines), len(GRID)), int)
    turned = [poses.yaw(angle) for angle in LATER]
    for name in later:
        least = ROUND * max(view.model(name).extent[:2])
        fits = np.zeros(found.shape, bool)
        for other in (_outline(view, name, turn) for turn in turned):
            points = _offsets(place, other, least)
            if there:
                points = points[Room(other, [each.outline for each in there]).gaps(points) > BY]
            for k, (outline, own) in enumerate(zip(outlines, offsets, strict=True)):
                apart = (points[None] - own[:, None]).reshape(-1, 2)
                gaps = Room(other, [outline]).gaps(apart).reshape(len(own), -1)
                fits[k] |= (gaps > BY).any(axis=1)
        found += fits
    return found.reshape(-1)
