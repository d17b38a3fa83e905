"""How things stand to each other, each law once: pure functions over arrays of worlds ``(N, ...)``.

The success evaluator asks them of the true state and conditions of what is estimated (`Whereabouts`), so that
they differ by what is estimated wrongly, and by nothing else.
"""

from __future__ import annotations

import abc
import math
from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.fact_arrays import take_rows
from bt_tasksim.core.poses import Array, array_namespace, constant

IN_ONE_ANOTHER = 0.002
"""Metres by which outlines of what stands beside each other may overlap: one may lean on the other."""
SUNK = 0.01
"""Metres by which an object's middle may seem to be below a container's floor, or its lowest point off it
where it stands on it."""
ABOVE = 0.002
"""Metres from which what is over another thing is higher than that stands: it rests on it, or in it."""
BORNE = 0.02
"""Metres above a surface from which on what seems to be there does not rest on it."""
BELOW = 0.01
"""Metres by which what stands on a surface may seem to be below it."""
DIRECTIONS = 90
"""Level lines along which two outlines are looked at for a gap, besides their own edges."""


class PlacedObject(NamedTuple):
    """An object in ``N`` worlds.

    Attributes:
        pose: Poses ``(N, 7)``.
        corners: Corners ``(N, m, 3)`` of its convex hull in its own frame, metres; some may be there twice.
        cubic: Booleans ``(N,)``: any of its faces may be down.
    """

    pose: Array
    corners: Array
    cubic: Array

    @property
    def reach(self) -> Array:
        """Its corners ``(N, m, 3)`` where it is."""
        return poses.transform(self.pose[:, None, :], self.corners)


class LevelSurface(NamedTuple):
    """A level rectangle in ``N`` worlds, on which things may stand.

    Attributes:
        frame: Poses ``(N, 7)``; z is up.
        centre: Its middle ``(N, 2)`` in that frame, metres.
        half: Half its size ``(N, 2)``.
        carries: Booleans ``(N,)``: it is there, and of some furniture; a mark in the air carries nothing.
    """

    frame: Array
    centre: Array
    half: Array
    carries: Array


class Hollow(NamedTuple):
    """Where something may lie within a thing in ``N`` worlds.

    Attributes:
        frame: Poses ``(N, 7)`` of the thing.
        boxes: Boxes ``(N, k, 6)`` in that frame: middle and half size (x, y), floor and rim (z), metres.
    """

    frame: Array
    boxes: Array


class Whereabouts(abc.ABC):
    """Where objects and surfaces are in ``N`` worlds."""

    @property
    @abc.abstractmethod
    def bodies(self) -> Collection[str]:
        """Names of the objects."""

    @property
    @abc.abstractmethod
    def surfaces(self) -> Collection[str]:
        """Names of the places."""

    @abc.abstractmethod
    def body(self, name: str) -> PlacedObject:
        """An object; where it is not, or was never seen, its pose is not a number."""

    @abc.abstractmethod
    def surface(self, name: str) -> LevelSurface:
        """A place."""

    @abc.abstractmethod
    def hollow(self, name: str) -> Hollow:
        """The inside of a container, or of an object."""


class IsBeside(NamedTuple):
    """How an object stands next to another one, or to a place.

    Attributes:
        gap: Metres ``(N,)`` between the outlines from above; where they overlap, minus the depth.
        height: Metres ``(N,)`` by which its lowest point is higher than that of the other one.
        lean: Radians ``(N,)`` from upright.
        other_lean: Those of the other one; 0 of a place.
    """

    gap: Array
    height: Array
    lean: Array
    other_lean: Array

    def holds(self, distance: float, level: float, angle: float) -> Array:
        """It is beside the other one: booleans ``(N,)``; limits in metres and radians."""
        near = (self.gap <= distance) & (self.gap >= -IN_ONE_ANOTHER)
        return near & (abs(self.height) <= level) & (self.lean <= angle) & (self.other_lean <= angle)


class IsOn(NamedTuple):
    """How an object stands on a place, or on another object.

    Attributes:
        aside: Metres ``(N,)`` by which its middle is beyond the edges.
        height: Metres ``(N,)`` from the surface up to its lowest point.
        lean: Radians ``(N,)`` from upright.
        elsewhere: Booleans ``(N,)``: it rests on, or in, something else that is there.
    """

    aside: Array
    height: Array
    lean: Array
    elsewhere: Array

    def is_borne(self, by_object: bool) -> Array:
        """Nothing else bears it: booleans ``(N,)``; what stands on an object has its middle over that."""
        return ~self.elsewhere & (self.aside <= 0.0) if by_object else ~self.elsewhere

    def holds(self, level: float, angle: float) -> Array:
        """It stands there: booleans ``(N,)``; limits in metres and radians."""
        above = (self.aside <= 0.0) & (abs(self.height) <= level)
        return above & (self.lean <= angle) & ~self.elsewhere


def is_beside(where: Whereabouts, name: str, other: str) -> IsBeside:
    """How an object stands next to another one, or to a place."""
    body = where.body(name)
    reach = body.reach
    if other in where.bodies:
        second = where.body(other)
        there, floor, frame = second.reach, lowest(second), second.pose
        lean = leaning(second.pose[:, 3:], second.cubic)
    else:
        surface = where.surface(other)
        there, floor, frame = _rectangle(surface), surface.frame[:, 2], surface.frame
        lean = array_namespace(floor).zeros_like(floor)
    normals = array_namespace(reach).concat([_normals(body.pose), _normals(frame)], axis=1)
    gap = between(reach[..., :2], there[..., :2], normals)
    return IsBeside(gap, lowest(body) - floor, leaning(body.pose[:, 3:], body.cubic), lean)


def is_on(where: Whereabouts, name: str, place: str) -> IsOn:
    """How an object stands on a place, or on another object."""
    body = where.body(name)
    low = lowest(body)
    if place in where.bodies:
        below = where.body(place)
        xp = array_namespace(low)
        aside, level = _beyond_outline(body.pose, below), xp.max(below.reach[..., 2], axis=-1)
    else:
        surface = where.surface(place)
        aside = beyond_edges(surface.frame, surface.centre, surface.half, body.pose)
        level = surface.frame[:, 2]
    elsewhere = _rests_elsewhere(where, (name, place), body, low, level)
    lean = leaning(body.pose[:, 3:], body.cubic)
    return IsOn(poses.clip(aside, 0.0, math.inf), low - level, lean, elsewhere)


def beyond_walls(where: Whereabouts, name: str, place: str) -> Array:
    """Metres ``(N,)`` by which an object's middle is outside a container, or the hollow of another object.

    Below 0 it is inside. Above the rim it is outside, unless it stands on the floor: a low tray has things in
    it that are taller.
    """
    return beyond_hollow(where.body(name), where.hollow(place))


def beyond_hollow(body: PlacedObject, hollow: Hollow) -> Array:
    """Metres ``(N,)`` by which an object's middle is outside a hollow, see `beyond_walls`."""
    xp = array_namespace(body.pose)
    middle = poses.localise(hollow.frame, body.pose[:, :3])
    low = xp.min(poses.localise(hollow.frame[:, None, :], body.reach)[..., 2], axis=-1)[:, None]
    boxes, height = hollow.boxes, middle[:, 2][:, None]
    aside = xp.max(abs(middle[:, None, :2] - boxes[..., :2]) - boxes[..., 2:4], axis=-1)
    floor, rim = boxes[..., 4], boxes[..., 5]
    above = xp.minimum(height - rim, abs(low - floor) - SUNK)
    return xp.min(xp.maximum(aside, xp.maximum(above, floor - SUNK - height)), axis=-1)


def floats(where: Whereabouts, name: str, container: str) -> Array:
    """Booleans ``(N,)``: nothing known is right below an object, so it is not at rest where it seems to be.

    Args:
        where: Where everything is.
        name: The object.
        container: Something that bears what is below its rim, too.
    """
    body, hollow = where.body(name), where.hollow(container)
    rim = hollow.frame[:, 2] + array_namespace(body.pose).max(hollow.boxes[..., 5], axis=-1)
    return ~((lowest(body) < rim + BORNE) | is_borne(where, name))


def is_borne(where: Whereabouts, name: str) -> Array:
    """Booleans ``(N,)``: a known surface, or the top of a known object, is right below an object's middle."""
    body = where.body(name)
    low = lowest(body)
    xp = array_namespace(low)
    borne = xp.zeros_like(low) > 1.0
    for surface in (where.surface(place) for place in where.surfaces):
        over = beyond_edges(surface.frame, surface.centre, surface.half, body.pose) <= 0.0
        borne = borne | (surface.carries & over & (abs(low - surface.frame[:, 2]) < BORNE))
    for other in (where.body(other) for other in where.bodies if other != name):
        top = xp.max(other.reach[..., 2], axis=-1)
        borne = borne | ((_beyond_outline(body.pose, other) <= 0.0) & (abs(low - top) < BORNE))
    return borne


def beyond_opening(body: PlacedObject, hollow: Hollow) -> Array:
    """Metres ``(N,)`` by which an object reaches beyond a hollow, seen along that one's z axis; 0 within."""
    xp = array_namespace(body.pose)
    flat = poses.localise(hollow.frame[:, None, :], body.reach)[:, :, None, :2]
    boxes = hollow.boxes[:, None, :, :]
    aside = xp.max(abs(flat - boxes[..., :2]) - boxes[..., 2:4], axis=-1)
    return poses.clip(xp.max(xp.min(aside, axis=-1), axis=-1), 0.0, math.inf)


def lowest(body: PlacedObject) -> Array:
    """Height ``(N,)`` in metres of an object's lowest point."""
    return array_namespace(body.pose).min(body.reach[..., 2], axis=-1)


def leaning(rotation: Array, cubic: Array) -> Array:
    """Angle ``(N,)`` in radians from upright of rotations ``(N, 4)``.

    Of what is cubic, booleans ``(N,)``, any face may be down.
    """
    xp = array_namespace(rotation)
    x, y, z = (poses.rotate(rotation, constant(axis, rotation))[:, 2] for axis in _AXES)
    faces = xp.maximum(abs(z), xp.maximum(abs(x), abs(y)))
    return xp.acos(poses.clip(xp.where(cubic, faces, z), -1.0, 1.0))


def rise_of_long_axis(rotation: Array, extent: Array) -> Array:
    """Angle ``(N,)`` in radians between the longest axis of things and the level, from 0 to a right angle.

    Of what is hardly longer than wide or high it is the axis that is longest nevertheless.

    Args:
        rotation: Rotations ``(N, 4)``.
        extent: Full sizes ``(N, 3)`` of their bounding boxes, metres.
    """
    xp = array_namespace(rotation)
    longest = xp.argmax(extent, axis=-1)
    up = xp.stack([poses.rotate(rotation, constant(axis, rotation))[:, 2] for axis in _AXES], axis=-1)
    return xp.asin(poses.clip(abs(take_rows(up, longest)), 0.0, 1.0))


def beyond_edges(frame: Array, centre: Array, half: Array, now: Array) -> Array:
    """Distance ``(N,)`` in metres by which objects are not above a rectangle; 0 where they are.

    Args:
        frame: Poses ``(N, 7)`` of the surfaces.
        centre: Middles ``(N, 2)`` of the rectangles in these frames.
        half: Their half sizes ``(N, 2)``.
        now: Poses ``(N, 7)`` of the objects.
    """
    local = poses.localise(frame, now[:, :3])[:, :2]
    return poses.norm(poses.clip(abs(local - centre) - half, 0.0, math.inf))


def between(a: Array, b: Array, normals: Array) -> Array:
    """Metres ``(N,)`` between the convex outlines of points; where they overlap, minus the depth.

    The largest gap along any of the normals and `DIRECTIONS` lines all around: exact where the normals are
    those of the edges that are nearest, and elsewhere too small by up to 2 % of half an edge.

    Args:
        a: Points ``(N, m, 2)`` of one thing.
        b: Points ``(N, k, 2)`` of the other one.
        normals: Unit vectors ``(N, d, 2)``, in any order and of any sign.
    """
    xp = array_namespace(a)
    around = xp.zeros_like(normals[:, :1, :]) + constant(_AROUND, normals)[None, :, :]
    every = xp.concat([around, normals], axis=1)
    (a_low, a_high), (b_low, b_high) = (_span(points, every) for points in (a, b))
    return xp.max(xp.maximum(b_low - a_high, a_low - b_high), axis=-1)


def _span(points: Array, normals: Array) -> tuple[Array, Array]:
    """How far points ``(N, m, 2)`` reach both ways along normals ``(N, d, 2)``: ``(N, d)`` twice."""
    xp = array_namespace(points)
    along = points[:, :, None, 0] * normals[:, None, :, 0] + points[:, :, None, 1] * normals[:, None, :, 1]
    return xp.min(along, axis=1), xp.max(along, axis=1)


def _normals(frame: Array) -> Array:
    """Level unit vectors ``(N, 3, 2)`` across the axes of frames ``(N, 7)``, as a box has edges along them.

    Across an axis that is upright it is the x axis of the world.
    """
    xp, found = array_namespace(frame), []
    for axis in _AXES:
        along = poses.rotate(frame[:, 3:], constant(axis, frame))
        across = xp.stack([-along[:, 1], along[:, 0]], axis=-1)
        length = poses.norm(across)[:, None]
        known = length > 1e-6
        unit = across / xp.where(known, length, xp.ones_like(length))
        found.append(xp.where(known, unit, xp.zeros_like(unit) + constant([1.0, 0.0], frame)))
    return xp.stack(found, axis=1)


def _rectangle(surface: LevelSurface) -> Array:
    """Corners ``(N, 4, 3)`` of surfaces."""
    xp = array_namespace(surface.frame)
    flat = surface.centre[:, None, :] + constant(_SIGNS, surface.half)[None] * surface.half[:, None, :]
    corners = xp.concat([flat, xp.zeros_like(flat[..., :1])], axis=-1)
    return poses.transform(surface.frame[:, None, :], corners)


def _beyond_outline(pose: Array, below: PlacedObject) -> Array:
    """Metres ``(N,)`` by which the middles of objects with poses ``(N, 7)`` are not over another one."""
    return between(pose[:, None, :2], below.reach[..., :2], _normals(below.pose))


def _rests_elsewhere(
    where: Whereabouts, names: tuple[str, str], body: PlacedObject, low: Array, level: Array
) -> Array:
    """Booleans ``(N,)``: what is right below objects is not the surface on which they should stand.

    It is another surface that they are nearer to; or an object that stands on that surface and under their
    middle, and lower than they do; or one that they reach over, and whose top they are nearer to: what
    bridges two slabs has neither of them under its middle.

    Args:
        where: Where everything is.
        names: The object, and what it should stand on.
        body: The objects.
        low: Heights ``(N,)`` of their lowest points, metres.
        level: Heights ``(N,)`` of the surfaces on which they should stand.
    """
    found = low != low  # not a number: unknown, and so it stands nowhere
    xp, pose = array_namespace(low), body.pose
    for name in where.surfaces:
        if name not in names:
            other = where.surface(name)
            there = other.carries & (beyond_edges(other.frame, other.centre, other.half, pose) <= 0.0)
            height = other.frame[:, 2]
            nearer = (abs(low - height) < abs(low - level)) & (abs(height - level) > ABOVE)
            found = found | (there & nearer)
    for name in where.bodies:
        if name not in names:
            other_body = where.body(name)
            floor, reach = lowest(other_body), other_body.reach
            there = (_beyond_outline(pose, other_body) <= 0.0) & (floor > level - BELOW)
            found = found | (there & (low > floor + ABOVE))
            top = xp.max(reach[..., 2], axis=-1)
            nearer = (top > level + BELOW) & (abs(low - top) < abs(low - level))
            if bool(xp.any(nearer)):
                normals = xp.concat([_normals(pose), _normals(other_body.pose)], axis=1)
                over = between(body.reach[..., :2], reach[..., :2], normals) < -IN_ONE_ANOTHER
                found = found | (nearer & over)
    return found


_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_SIGNS = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))
_ANGLES = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
_AROUND = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])
