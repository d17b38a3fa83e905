"""Whether a hand can take a part of furniture by its own grasps, which say how hands come to them."""

from __future__ import annotations

import numpy as np

from bt_tasksim.concept_nodes.grasp_candidates import LEANING, across
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.grips import Grips, fits_between

BACK = (0.0, 0.02)
"""Metres by which a hand may be held back from the middle of a grasp."""


def part_tool_poses(robot: RobotDescription, pose: Array, grips: Grips) -> Array:
    """Tool poses ``(n, 7)`` that take a part of furniture, robot base frame.

    Unlike an object, it stands on no place that says from where hands come: its grasps do, or leave it open.

    Args:
        robot: The robot.
        pose: The part's pose ``(7,)``, robot base frame.
        grips: Its grasps.
    """
    found = []
    for k in np.flatnonzero(fits_between(grips.widths, robot.opening)):
        axis, at = poses.rotate(pose[3:], grips.closing[k]), poses.transform(pose, grips.points[k])
        for along in _ways(pose, axis, grips.approach[k]):
            for side in (axis, -axis):
                rotation = poses.frame_from_axes(along, side)
                found += [poses.pose(at - back * along, rotation) for back in BACK]
    return np.array(found).reshape(-1, 7)


def _ways(pose: Array, axis: Array, approach: Array) -> Array:
    """Unit vectors ``(k, 3)`` along which hands may come: about a given one, or all around the axis."""
    if not np.isfinite(approach).all():
        return across(axis)
    turns = poses.from_rotation_vector(np.array(LEANING)[:, None] * axis)
    return poses.rotate(turns, poses.rotate(pose[3:], approach)[None])
