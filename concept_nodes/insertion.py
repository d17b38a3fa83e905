"""The poses in which something fits into a hole, and where it really is in a hand of two flat fingers."""

from __future__ import annotations

import itertools

import numpy as np

from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import HOLE, PlaceModel
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.hand import standing_side

FLUSH = 0.35
"""Radians between a face of a held object, as it is seen, and the finger on it, up to which it lies flat."""
UP = np.array([0.0, 0.0, 1.0])
TIGHT = 5e-4
"""Metres by which something may be larger than a hole, as sizes are known."""

PITCH, UNSURE, SURE = 0.001, 0.008, 0.002
"""Metres from one place to the next of a spiral about the mouth, and its half axes: along the faces of
fingers it is not known well how something lies in a hand, across them it is."""
AROUND = (0.006, 0.006, 0.0015)
"""Half axes and pitch of the same for hands that do not close flat."""


def hole_of(view: WorldView, name: str) -> PlaceModel:
    """A hole of the world.

    Raises:
        NoWayError: The place is none.
    """
    place = view.world.places[name]
    if place.kind != HOLE:
        raise NoWayError(
            f"'{name}' is no hole but a {place.kind}: things are put there with Place, or fall there with "
            "Release"
        )
    return place


def fitting_poses(view: WorldView, target: str, hole: PlaceModel, leading: Array | None = None) -> Array:
    """Poses ``(k, 7)`` of an object at a hole's stop, the least turned from its present one first.

    Args:
        view: The world.
        target: The object.
        hole: The hole.
        leading: Axis ``(3,)`` of the object, along its box, that has to go in first; None for any.

    Raises:
        NoWayError: It does not fit; says how large both are.
    """
    model, now = view.model(target), view.objects[target]
    size, room = np.array(model.extent), np.array(hole.extent)
    frame, found = np.asarray(hole.pose), []
    for turn in box_turns():
        across = abs(poses.to_matrix(turn)) @ size
        if (across[:2] > room + TIGHT).any():
            continue
        if leading is not None and float(poses.rotate(turn, leading)[2]) > -0.9:
            continue
        rotation = poses.quat_multiply(frame[3:], turn)
        if model.symmetry == 0 and not model.cubic and abs(float(poses.rotate(turn, UP)[2])) > 0.9:
            rotation = _nearest_heading(now[3:], poses.rotate(rotation, UP))
        position = poses.transform(frame, np.array([*hole.centre, across[2] / 2]))
        found.append(np.concatenate([position, rotation]))
    if not found:
        mm = " x ".join(f"{1000 * v:.0f}" for v in size)
        raise NoWayError(
            f"{target} ({mm} mm) does not fit into {hole.name} "
            f"({1000 * room[0]:.0f} x {1000 * room[1]:.0f} mm): take a smaller one, or another hole"
        )
    every = np.array(found)
    angles = poses.angle_between(every[:, 3:], now[None, 3:])
    ordered: Array = every[np.argsort(np.round(angles, 6), kind="stable")]
    return ordered


def closes_flat(robot: RobotDescription) -> bool:
    """A hand of two fingers that close evenly: it knows what is between them across their faces."""
    return not robot.many_fingers and standing_side(robot) is None


def in_fingers(view: WorldView, target: str) -> Array:
    """Pose ``(7,)`` of a held object: as it is seen, but flat between the fingers and midway between them.

    Of two fingers that close evenly on flat faces the hand knows that better than any camera does.
    """
    seen, robot, model = view.objects[target], view.robot, view.model(target)
    if not closes_flat(robot) or model.symmetry == 0:
        return seen
    closing = poses.to_matrix(view.tool[3:])[:, 1]
    axes = poses.to_matrix(seen[3:]).T
    along = axes @ closing
    k = int(abs(along).argmax())
    angle = float(np.arccos(min(1.0, abs(along[k]))))
    if angle > FLUSH or not any(abs(axis[k]) > 0.99 for axis in model.grasp_axes):
        return seen
    face = np.sign(along[k]) * axes[k]
    turn = np.cross(face, closing)
    length = float(np.linalg.norm(turn))
    turn = turn * (angle / length) if length > 1e-9 else np.zeros(3)
    rotation = poses.quat_multiply(poses.from_rotation_vector(turn), seen[3:])
    aside = float((seen[:3] - view.tool[:3]) @ closing)
    return np.concatenate([seen[:3] - aside * closing, rotation])


def box_turns() -> Array:
    """The rotations ``(24, 4)`` that bring a box's axes onto each other."""
    quarters = [np.array([np.sqrt(0.5), *(np.sqrt(0.5) * axis)]) for axis in np.eye(3)]
    found = [np.array([1.0, 0.0, 0.0, 0.0])]
    for a, b, c in itertools.product(range(4), repeat=3):
        turn = found[0]
        for count, quarter in zip((a, b, c), quarters, strict=True):
            for _ in range(count):
                turn = poses.quat_multiply(quarter, turn)
        if all(abs(float(turn @ other)) < 0.999 for other in found):
            found.append(turn)
    return np.array(found)


def _nearest_heading(now: Array, up: Array) -> Array:
    """Of the rotations that bring an object's z axis along ``up (3,)`` the one nearest to ``now (4,)``."""
    turn = poses.shortest_turn(poses.rotate(now, UP), up, poses.rotate(now, np.array([1.0, 0.0, 0.0])))
    found: Array = poses.quat_multiply(poses.from_rotation_vector(turn), now)
    return found


def spiral(long: float, wide: float, pitch: float) -> Array:
    """Places ``(k, 2)`` in an ellipse in the order in which they are tried, metres, the middle first.

    Args:
        long: Its half axis along x.
        wide: Its half axis along y.
        pitch: From one place to the next.
    """
    steps = [np.arange(-int(half / pitch), int(half / pitch) + 1) * pitch for half in (long, wide)]
    grid = np.array(list(itertools.product(*steps)))
    far = np.hypot(grid[:, 0] / long, grid[:, 1] / wide)
    grid, far = grid[far <= 1.0 + 1e-9], far[far <= 1.0 + 1e-9]
    order = np.lexsort((np.arctan2(grid[:, 1], grid[:, 0]), np.round(far, 1)))
    found: Array = grid[order]
    return found


PLACES = spiral(UNSURE, SURE, PITCH)
ROUND = spiral(*AROUND)


def places_to_try(robot: RobotDescription) -> Array:
    """Places ``(k, 2)`` about the mouth that a hand tries one after the other, metres."""
    return PLACES if closes_flat(robot) else ROUND
