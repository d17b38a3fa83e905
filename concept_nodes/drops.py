"""Where an object may fall into a container, in one world, so that what is in there stays low.

What falls on other things may come to rest with its middle above the rim, or roll over it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bt_tasksim.concept_nodes.spots import corners_of, outline_of, outline_turned, surface_of
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
from bt_tasksim.core.world import ObjectModel, PlaceModel
from bt_tasksim.planning.room import Room
from bt_tasksim.scene.outlines import hull

WALL = 0.008
"""Metres that an outline keeps from the walls, where the container is large enough for that."""
TUMBLES, AT_MOST = 0.6, 0.02
"""Share of its larger side from above that an object's middle keeps from the walls, since it may turn as it
falls; but no more than so many metres beyond its own outline: what is long lies down as it is."""
CLEAR = 0.004
"""Smallest gap in metres at which an object falls beside another one rather than on it."""
FOR_OTHERS = 0.01
"""Metres of gap that are left for what is to come."""
AMPLE = 0.03
"""Metres of gap beyond which a wider one counts no more."""
STEP = 0.01
"""Metres of height, and of gap, that make a difference."""
_SHARES = (0.0, -1.0, 1.0, -0.5, 0.5)
GRID = np.stack(np.meshgrid(_SHARES, _SHARES, indexing="ij"), axis=-1).reshape(-1, 2)
"""Where in a container things are let go: shares of the way from its middle to its walls."""
ALONG_WALLS = (0.0, np.pi / 2)
"""Headings in which room is sought for what is to come."""


class _Lying(NamedTuple):
    """Something in a container.

    Attributes:
        name: Its name.
        outline: Corners ``(n, 2)`` of its outline, in the container's frame, metres.
        top: Metres above the floor to which it reaches.
    """

    name: str
    outline: Array
    top: float


def preferred_options(
    view: WorldView,
    target: str,
    reference: str,
    hovers: Sequence[float] = (0.0,),
    later: Sequence[str] = (),
) -> Array:
    """Poses ``(k, 7)`` of an object over a place or another object, in the order in which they are preferred.

    They are of one height after the other. Over a container see `drops`; elsewhere they are those of
    `standing_options`, the least turned first.

    Args:
        view: The world.
        target: The object.
        reference: The place, or the other object.
        hovers: Free heights below it, metres; over a container, above its rim.
        later: Objects that may still be put there, too.
    """
    place, now = view.world.places.get(reference), view.objects[target][3:]
    if place is not None and place.container:
        found = drops(view, target, place, later)
    else:
        found = nearest_first(standing_options(view, target, reference), now)
    return np.concatenate([poses.shifted(found, np.array([0.0, 0.0, hover])) for hover in hovers])


def drops(view: WorldView, target: str, place: PlaceModel, later: Sequence[str] = ()) -> Array:
    """Poses ``(k, 7)`` at a container's rim in which an object may be let go, the best first.

    Of two, the one is better that

    1. reaches less far over the walls, seen from above;
    2. is over the floor, or else over what is lower;
    3. leaves room on the floor for more of what is to come;
    4. is farther from what it does not fall on;
    5. is turned less from how the object is now; and
    6. is nearer to the middle.

    Args:
        view: The world.
        target: The object.
        place: The container.
        later: Objects that may still fall into it; those that lie there already do not count.
    """
    frame, rim = reference_frame(view, place.name)
    model, now, turns = view.model(target), view.objects[target][3:], headings()
    height = standing_height(model) + rim
    outlines = [outline_turned(model, turn) for turn in turns]
    offsets = [_offsets(place, outline, model) for outline in outlines]
    beyond = np.repeat([_beyond(place, outline) for outline in outlines], len(GRID))
    points, there = np.concatenate(offsets), _lying(view, target, place)
    falls = [_falls(outline, some, there) for outline, some in zip(outlines, offsets, strict=True)]
    on, gap = np.concatenate(falls).T
    coming = [n for n in later if n in view.objects and not any(each.name == n for each in there)]
    rooms = _rooms(view, place, outlines, offsets, there, coming)
    rotations = poses.quat_multiply(frame[None, 3:], np.repeat(turns, len(GRID), axis=0))
    angles = np.round(poses.angle_between(rotations, now[None]), 6)
    aside = np.round(np.linalg.norm(points - np.asarray(place.centre), axis=-1), 6)
    order = np.lexsort([aside, angles, -gap, -rooms, on, beyond])
    positions = poses.transform(frame, np.column_stack([points, np.full(len(points), height)]))
    found: Array = np.concatenate([positions, rotations], axis=-1)[order]
    return found


def lies_in(view: WorldView, target: str, place: PlaceModel) -> bool:
    """Whether something other than an object lies in a container, or a spot is marked in it."""
    return bool(_lying(view, target, place))


def _offsets(place: PlaceModel, outline: Array, model: ObjectModel) -> Array:
    """Points ``(25, 2)`` in a container's frame at which an outline about its origin is within the walls.

    Along an axis on which it does not fit, they are over the middle.

    Args:
        place: The container.
        outline: Corners ``(n, 2)`` of the outline, metres.
        model: The object whose outline it is.
    """
    middle, half = np.asarray(place.centre), np.asarray(place.extent) / 2
    own = np.abs(outline).max(axis=0)
    tumbles = np.minimum(TUMBLES * max(model.extent[:2]), own + AT_MOST)
    room = half - np.maximum(own + WALL, tumbles)
    found: Array = middle + np.maximum(room, 0.0) * GRID
    return found


def _beyond(place: PlaceModel, outline: Array) -> float:
    """Metres by which an outline ``(n, 2)`` about a container's middle reaches over its walls, in steps."""
    over = np.abs(outline).max(axis=0) - np.asarray(place.extent) / 2
    return STEP * float(np.ceil(max(0.0, *over) / STEP - 1e-6))


def _lying(view: WorldView, target: str, place: PlaceModel) -> list[_Lying]:
    """What is in a container, and the spots that are marked in it: something else is to stand there."""
    frame, middle, half = np.asarray(place.pose), np.asarray(place.centre), np.asarray(place.extent) / 2
    walls = middle + half * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    found = []
    for name, pose in view.objects.items():
        if name == target or not np.isfinite(pose).all():
            continue
        corners = poses.localise(frame, corners_of(view, name))
        outline, low, top = hull(corners[:, :2]), float(corners[:, 2].min()), float(corners[:, 2].max())
        within = float(Room(outline, [walls]).gaps(np.zeros((1, 2)))[0]) < 0.0
        if within and low < place.height and top > 0.0:
            found.append(_Lying(name, outline, top))
    for name, spot in view.world.places.items():
        at = poses.localise(frame, np.asarray(spot.pose)[:3])[:2]
        if spot.kind == "spot" and bool((abs(at - middle) < half).all()):
            edges = outline_of(surface_of(view, name))
            flat = np.column_stack([edges, np.full(len(edges), spot.pose[2])])
            found.append(_Lying(name, hull(poses.localise(frame, flat)[:, :2]), place.height))
    return found


def _falls(outline: Array, points: Array, there: Sequence[_Lying]) -> Array:
    """How high it is what an outline at ``points (k, 2)`` falls on, and its gap to the others ``(k, 2)``.

    Both in metres, in steps of `STEP`; the floor has height 0.
    """
    on, gap = np.zeros(len(points)), np.full(len(points), AMPLE)
    for each in there:
        apart = Room(outline, [each.outline]).gaps(points)
        below = apart < CLEAR
        on = np.where(below, np.maximum(on, each.top), on)
        gap = np.where(below, gap, np.minimum(gap, apart))
    return STEP * np.stack([np.ceil(on / STEP - 1e-6), np.round(gap / STEP)], axis=-1)


def _rooms(
    view: WorldView,
    place: PlaceModel,
    outlines: Sequence[Array],
    offsets: Sequence[Array],
    there: Sequence[_Lying],
    later: Sequence[str],
) -> Array:
    """How many of some objects would find the floor beside each outline ``(n * 25,)``, each by itself."""
    found = np.zeros((len(outlines), len(GRID)), int)
    turned = [poses.yaw(angle) for angle in ALONG_WALLS]
    for name in later:
        model = view.model(name)
        fits = np.zeros(found.shape, bool)
        for other in (outline_turned(model, turn) for turn in turned):
            points = _offsets(place, other, model)
            if there:
                points = points[Room(other, [each.outline for each in there]).gaps(points) > CLEAR]
            for k, (outline, own) in enumerate(zip(outlines, offsets, strict=True)):
                apart = (points[None] - own[:, None]).reshape(-1, 2)
                gaps = Room(other, [outline]).gaps(apart).reshape(len(own), -1)
                fits[k] |= (gaps > FOR_OTHERS).any(axis=1)
        found += fits
    return found.reshape(-1)
