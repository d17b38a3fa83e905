"""Where the tool has to be to grasp an object, from what is known of the object and of what it stands on."""

from __future__ import annotations

import math

import numpy as np

from bt_tasksim.concept.context import Seen
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel, PlaceModel

DOWN = (0.0, 0.0, -1.0)


def resting_place(seen: Seen, target: str) -> PlaceModel | None:
    """The place on which an object seems to stand, or None where it is on none."""
    pose = seen.object(target)
    half = seen.model(target).extent[2] / 2
    best: tuple[float, PlaceModel] | None = None
    for place in seen.world.places.values():
        local = poses.transform(poses.inverse(place.pose), pose[:3])
        inside = all(abs(float(local[i]) - place.centre[i]) <= place.extent[i] / 2 + 0.02 for i in range(2))
        gap = abs(float(local[2]) - half)
        if inside and gap < 0.05 and (best is None or gap < best[0] - 1e-6):
            best = (gap, place)
    return best[1] if best else None


def grasp_pose(seen: Seen, target: str, approach: Array | None = None, closing: Array | None = None) -> Array:
    """The tool pose ``(7,)`` for a grasp of an object at its estimated pose.

    Of the object's grasp axes those count that lie across the approach and fit into the hand; of the tool
    orientations that they leave, the one nearest to the hand's neutral one there is taken.
    """
    pose, model = seen.object(target), seen.model(target)
    if approach is None:
        place = resting_place(seen, target)
        approach = DOWN if place is None else place.access
    a = np.asarray(approach, float)
    neutral = neutral_rotation(seen, a, pose[:3])
    best: tuple[float, Array] | None = None
    for rank, c in enumerate(_closing_axes(seen, pose, model, a, neutral, closing)):
        for sign in (1.0, -1.0):
            rotation = poses.frame_from_axes(a, sign * c)
            cost = float(poses.angle_between(neutral, rotation)) + 0.3 * rank
            if best is None or cost < best[0] - 1e-9:
                best = (cost, rotation)
    assert best is not None
    rotation = best[1]
    reach = half_extent(pose, model, a)
    position = pose[:3] - max(0.0, reach - seen.robot.depth) * a
    return poses.pose(position, rotation)


def neutral_rotation(seen: Seen, approach: Array, position: Array) -> Array:
    """The tool orientation ``(4,)`` in which the arm is farthest from its joints' limits.

    It is the one that the closing axis of the rest posture has when the arm's base turns to ``position``.

    Args:
        seen: What is seen.
        approach: Unit vector ``(3,)`` along which the tool comes, robot base frame.
        position: Where the tool is going to be, ``(3,)`` metres.
    """
    closing = poses.rotate(poses.yaw(math.atan2(position[1], position[0])), seen.robot.closing)
    return poses.frame_from_axes(approach, closing)


def _closing_axes(
    seen: Seen, pose: Array, model: ObjectModel, approach: Array, neutral: Array, closing: Array | None
) -> list[Array]:
    upright = poses.z_axis(pose[3:])
    if closing is not None:
        return [poses.rotate(pose[3:], np.asarray(closing, float))]
    if model.symmetry == 0 and abs(float(upright @ approach)) > 0.7:  # any direction across the axis
        tool_y = poses.rotate(neutral, np.array([0.0, 1.0, 0.0]))
        across = tool_y - (tool_y @ approach) * approach
        if float(np.linalg.norm(across)) > 0.3:
            return [across / np.linalg.norm(across)]
    if model.symmetry == 0:  # from the side: across the object's axis and the approach
        across = poses.cross(upright, approach)
        return [across / np.linalg.norm(across)]
    axes = []
    for axis, width in zip(model.grasp_axes, model.grasp_widths, strict=True):
        c = poses.rotate(pose[3:], np.asarray(axis))
        if abs(float(c @ approach)) < 0.5 and width < seen.world.opening - 0.006:
            axes.append(c)
    if axes:
        return axes
    fallback = poses.cross(approach, upright if abs(float(upright @ approach)) < 0.9 else pose[:3])
    return [fallback / np.linalg.norm(fallback)]


def half_extent(pose: Array, model: ObjectModel, direction: Array) -> float:
    """Half the size of an object's bounding box along a direction, metres."""
    local = poses.rotate(pose[3:] * np.array([1.0, -1.0, -1.0, -1.0]), direction)
    if model.symmetry == 0:
        radial, axial = float(np.hypot(local[0], local[1])), abs(float(local[2]))
        return (radial * model.extent[0] + axial * model.extent[2]) / 2
    return float(np.abs(local) @ np.asarray(model.extent)) / 2
