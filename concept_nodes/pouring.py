"""How a held vessel is tilted so that what is in it falls into another one: its poses, in one world.

The rim and the spout are where the vessel's hollow (`bt_tasksim.scene.hollows`) reaches farthest from its
middle. As it tilts, its lip stays over the opening, as low as the vessel's lowest point allows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bt_tasksim.concept_nodes.turning import STEP, steps
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array

WALL = 0.004
"""Metres that a lip reaches beyond the hollow."""
SPOUT = 0.004
"""Metres by which the hollow reaches farther one way than the others where it has a spout."""
NARROW = 0.006
"""Metres beside a line through the middle within which the hollow counts as on it."""
DIRECTIONS = 16
"""Ways out of a round vessel that are looked at, and headings in which it may pour."""
BEFORE, FARTHEST = 0.3, 0.03
"""Share of the opening's half width by which the lip is on this side of its middle, and metres at most: what
rolls over a lip falls a little beyond it."""
NARROWEST = 0.045
"""Metres of an opening that what is poured hits for certain."""
CLEARANCE = 0.025
"""Metres that the vessel's lowest point is above the other one's rim."""


class Lip(NamedTuple):
    """Where a vessel pours.

    Attributes:
        way: Unit vector ``(2,)`` from its middle, in its own frame.
        point: The lip's edge ``(3,)`` in its own frame, metres.
        floor: Height of the hollow's floor there, metres.
    """

    way: Array
    point: Array
    floor: float


class Mouth(NamedTuple):
    """Where something is to fall into.

    Attributes:
        middle: ``(3,)`` at the height of its rim, robot base frame, metres.
        half: Half of its smaller width, metres.
    """

    middle: Array
    half: float


class Tilt(NamedTuple):
    """One way to pour.

    Attributes:
        poses: Poses ``(n, 7)`` of the vessel, upright at first.
        angles: How far it is tilted there ``(n,)``, radians.
    """

    poses: Array
    angles: Array


def lips(boxes: Array) -> list[Lip]:
    """Where a vessel with a hollow of ``boxes (k, 6)`` may pour: its spout, or all around.

    Args:
        boxes: See `bt_tasksim.scene.hollows.hollow`.
    """
    found = []
    rim, floor = float(boxes[:, 5].max()), float(boxes[:, 4].min())
    for k in range(DIRECTIONS):
        angle = 2 * math.pi * k / DIRECTIONS
        way = np.array([math.cos(angle), math.sin(angle)])
        across = np.array([-way[1], way[0]])
        on = np.abs(boxes[:, :2] @ across) <= NARROW
        on &= boxes[:, 5] >= rim - 1e-6
        if on.any():
            reach = float((boxes[on, :2] @ way + np.abs(boxes[on, 2:4]) @ np.abs(way)).max()) + WALL
            found.append(Lip(way, np.array([*(reach * way), rim]), floor))
    reaches = np.array([float(lip.point[:2] @ lip.way) for lip in found])
    if len(found) and float(reaches.max() - np.median(reaches)) > SPOUT:
        return [found[int(np.argmax(reaches))]]
    return found


def mouth_of(view: WorldView, into: str) -> Mouth:
    """Where something falls into a container or into the hollow of an object, or onto any other place.

    Raises:
        NoWayError: The object has no hollow, or does not stand upright.
    """
    place = view.world.places.get(into)
    if place is not None:
        height = place.height if place.container else 0.0
        middle = poses.transform(np.asarray(place.pose), np.array([*place.centre, height]))
        return Mouth(middle, min(place.extent) / 2)
    model, pose = view.model(into), view.objects[into]
    boxes = np.zeros((0, 6)) if model.solid is None else model.solid.hollow
    if not len(boxes):
        raise NoWayError(f"nothing can be poured into {into}: it has no hollow with a floor and walls around")
    if float(poses.tilt(pose[3:])) > math.radians(30.0):
        raise NoWayError(f"nothing can be poured into {into}: it does not stand upright")
    low = np.min(boxes[:, :2] - boxes[:, 2:4], axis=0)
    high = np.max(boxes[:, :2] + boxes[:, 2:4], axis=0)
    local = np.array([*((low + high) / 2), float(boxes[:, 5].max())])
    return Mouth(poses.transform(pose, local), float(min(high - low)) / 2)


def tilts(view: WorldView, target: str, into: str, most: float, height: float) -> list[Tilt]:
    """The ways in which a vessel may be tilted over another one, those first that turn it least from now.

    Args:
        view: The world.
        target: The vessel.
        into: The container or object.
        most: Radians by which it is tilted in the end.
        height: Metres that its lip is then above the rim.

    Raises:
        NoWayError: One of the two has no hollow, or the other one's opening is too narrow.
    """
    model = view.model(target)
    boxes = np.zeros((0, 6)) if model.solid is None else model.solid.hollow
    if not len(boxes):
        raise NoWayError(f"nothing can be poured out of {target}: it has no hollow with walls all around")
    assert model.solid is not None
    outer, mouth = model.solid.outer, mouth_of(view, into)
    if 2 * mouth.half < NARROWEST:
        raise NoWayError(
            f"the opening of {into} is {2000 * mouth.half:.0f} mm wide, and what falls out of {target} needs "
            f"{1000 * NARROWEST:.0f} mm: take a wider one"
        )
    now = view.objects[target]
    headings = [2 * math.pi * k / DIRECTIONS for k in range(DIRECTIONS)]
    found = [
        tilt
        for lip in lips(boxes)
        for tilt in _all_around(_tilt(outer, lip, mouth, most, height), mouth, headings)
    ]
    order = np.argsort(_far(now, np.array([tilt.poses[0] for tilt in found])), kind="stable")
    return [found[k] for k in order.tolist()]


def _far(now: Array, firsts: Array) -> Array:
    """How far ``(k,)`` it is from one pose ``(7,)`` to others ``(k, 7)``, metres and tenths of radians."""
    angle = poses.angle_between(firsts[:, 3:], now[None, 3:])
    found: Array = np.round(np.linalg.norm(firsts[:, :3] - now[:3], axis=-1) + 0.1 * angle, 6)
    return found


def _all_around(tilt: Tilt, mouth: Mouth, headings: Sequence[float]) -> list[Tilt]:
    """The same tilt towards other headings than 0, radians, robot base frame."""
    middle = np.array([*mouth.middle, 1.0, 0.0, 0.0, 0.0])
    local = poses.relative(middle[None], tilt.poses)
    turned = [np.concatenate([mouth.middle, poses.yaw(heading)]) for heading in headings]
    return [Tilt(poses.multiply(frame[None], local), tilt.angles) for frame in turned]


def _tilt(outer: Array, lip: Lip, mouth: Mouth, most: float, height: float) -> Tilt:
    """The poses in which a vessel pours along the x axis of the robot base frame.

    Args:
        outer: Corners ``(n, 3)`` of its hull.
        lip: Where it pours.
        mouth: What it pours into.
        most: Radians in the end.
        height: Metres of the lip above the rim in the end.
    """
    angles = np.concatenate([[0.0], steps(most, STEP)])
    turns = poses.from_rotation_vector(angles[:, None] * np.array([0.0, 1.0, 0.0]))
    rotations = poses.quat_multiply(turns, poses.yaw(-math.atan2(float(lip.way[1]), float(lip.way[0])))[None])
    edge = poses.rotate(rotations, np.tile(lip.point, (len(angles), 1)))
    lowest = poses.rotate(rotations[:, None, :], outer[None])[..., 2].min(axis=1)
    up = np.maximum(height, CLEARANCE + edge[:, 2] - lowest)
    aside = np.full(len(angles), -min(BEFORE * mouth.half, FARTHEST))
    over = mouth.middle + np.column_stack([aside, np.zeros(len(angles)), up])
    return Tilt(np.concatenate([over - edge, rotations], axis=-1), angles)


def pours_from(view: WorldView, target: str, contents: Sequence[str]) -> float:
    """Tilt in radians at which what is in an upright vessel may begin to come out; 0 where nothing is known.

    What is loose in it has a level surface at first, which meets the lip where the vessel is tilted by the
    angle between the line from the lip to the far side of what is in it and the level.
    """
    model = view.model(target)
    boxes = np.zeros((0, 6)) if model.solid is None else model.solid.hollow
    if not len(contents) or not len(boxes):
        return 0.0
    middles = np.array([poses.localise(view.objects[target], view.objects[name][:3]) for name in contents])
    radii = np.array([max(view.model(name).extent) / 2 for name in contents])
    top = float((middles[:, 2] + radii).max())
    across = float(np.max(boxes[:, :2] + boxes[:, 2:4]) - np.min(boxes[:, :2] - boxes[:, 2:4]))
    return math.atan2(max(float(boxes[:, 5].max()) - top, 0.0), across)
