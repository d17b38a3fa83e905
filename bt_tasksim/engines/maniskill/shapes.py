"""What an actor's collision shapes come to: an object of one of our kinds, or boxes of a fixture."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.sapien_world import array
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.shapes import shape_kind

EQUAL = 1e-6
"""Metres by which the sides of a cube may differ."""
ASLANT = 0.7
"""Least height of the end of a unit vector that points up rather than aside."""
LARGEST = 20.0
"""Metres: what is larger is a floor, and nothing to keep clear of."""
_UPRIGHT = np.array([math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0])
"""SAPIEN's cylinders lie along x, ours stand along z."""


@dataclass(frozen=True, eq=False)
class CollisionSolid:
    """An object's geometry.

    Attributes:
        kind: Its category.
        size: Full size ``(3,)`` in metres.
        frame: Our frame of it, with its origin in the middle of its bounding box, in the actor's ``(7,)``.
    """

    kind: str
    size: tuple[float, float, float]
    frame: Array


def solid(shapes: Sequence[Any], kind: str | None, owner: str) -> CollisionSolid:
    """The object that collision shapes come to.

    Args:
        shapes: SAPIEN's collision shapes of one body.
        kind: What their bounding box is taken for; None for what the only shape is.
        owner: Whose they are, for the error's sentence.

    Raises:
        InputError: There is none, or no kind of ours is like them, or the kind that is named is none.
    """
    if not shapes:
        raise InputError(f"{owner} has no collision shape, so it is no object; it can be a place")
    if kind is not None:
        shape_kind(kind)
        low, high = _bounds(shapes)
        return CollisionSolid(kind, _size(high - low), poses.pose((low + high) / 2))
    only = shapes[0] if len(shapes) == 1 else None
    frame = None if only is None else array(only.local_pose)
    match type(only).__name__:
        case "PhysxCollisionShapeBox":
            size = _size(2 * np.asarray(only.half_size))  # type: ignore[union-attr]
            assert frame is not None
            return CollisionSolid("cube" if max(size) - min(size) < EQUAL else "box", size, frame)
        case "PhysxCollisionShapeSphere":
            assert only is not None and frame is not None
            return CollisionSolid("superellipsoid", _size(np.full(3, 2 * only.radius)), frame)
        case "PhysxCollisionShapeCylinder":
            assert only is not None and frame is not None
            size = _size(2 * np.array([only.radius, only.radius, only.half_length]))
            return CollisionSolid("cylinder", size, poses.multiply(frame, poses.pose(np.zeros(3), _UPRIGHT)))
    raise InputError(
        f"{owner} is made of {len(shapes)} collision shapes or of one that is no box, ball or cylinder: say "
        "with 'kind' what its bounding box is taken for"
    )


def set_upright(found: CollisionSolid, actor: Array) -> CollisionSolid:
    """A box with its frame turned so that z is up with its actor at a pose ``(7,)``; others as they are.

    A peg may be turned a quarter about its own axis in its simulation; here z is up in what stands or lies.
    """
    rotation = poses.multiply(actor, found.frame)[3:]
    if found.kind != "box" or abs(float(poses.z_axis(rotation)[2])) > ASLANT:
        return found
    now = poses.to_matrix(rotation)
    turns = [turn for turn in _turns() if (now @ turn)[2, 2] > ASLANT]
    if not turns:  # on an edge
        return found
    turn = max(turns, key=lambda each: float(np.trace(each)))
    x, y, z = (np.abs(turn.T) @ np.array(found.size)).tolist()
    frame = poses.multiply(found.frame, poses.pose(np.zeros(3), poses.from_matrix(turn)))
    return CollisionSolid(found.kind, (x, y, z), frame)


def _turns() -> list[Array]:
    """The 24 rotations ``(3, 3)`` of a cube onto itself."""
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            turn = np.eye(3)[list(order)] * np.array(signs)
            if np.linalg.det(turn) > 0.0:
                found.append(turn)
    return found


def boxes(shapes: Sequence[Any], colour: tuple[float, float, float]) -> tuple[Box, ...]:
    """The boxes that collision shapes are within, in the actor's frame; floors are left out."""
    found = []
    for shape in shapes:
        low, high = _corners(shape).min(0), _corners(shape).max(0)
        if max(high - low) > LARGEST or not np.isfinite(high - low).all():
            continue
        pose = array(shape.local_pose)
        if type(shape).__name__ == "PhysxCollisionShapeBox":
            size = _size(2 * np.asarray(shape.half_size))
        else:
            pose, size = poses.pose((low + high) / 2), _size(high - low)
        friction = float(shape.physical_material.static_friction)
        found.append(Box(tuple(pose.tolist()), size, colour, friction))
    return tuple(found)


def _bounds(shapes: Sequence[Any]) -> tuple[Array, Array]:
    corners = np.concatenate([_corners(shape) for shape in shapes])
    return corners.min(0), corners.max(0)


def _corners(shape: Any) -> Array:
    """Points ``(n, 3)`` whose bounding box is that of a shape, in the actor's frame."""
    kind = type(shape).__name__
    if kind == "PhysxCollisionShapeBox":
        half = np.asarray(shape.half_size, float)
    elif kind == "PhysxCollisionShapeSphere":
        half = np.full(3, float(shape.radius))
    elif kind in ("PhysxCollisionShapeCylinder", "PhysxCollisionShapeCapsule"):
        end = float(shape.radius) if kind.endswith("Capsule") else 0.0
        half = np.array([float(shape.half_length) + end, float(shape.radius), float(shape.radius)])
    elif hasattr(shape, "vertices"):
        scaled = np.asarray(shape.vertices, float) * np.asarray(shape.scale, float)
        return poses.transform(array(shape.local_pose), scaled)
    else:  # a plane
        half = np.full(3, np.inf)
        return np.stack([-half, half])
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    return poses.transform(array(shape.local_pose), signs * half)


def _size(values: Array) -> tuple[float, float, float]:
    """A size without the noise of single precision: to the nearest micrometre."""
    x, y, z = (round(float(v), 6) for v in values)
    return x, y, z
