"""What a robot's arm reaches in front of its base: from above and from the front."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array

if TYPE_CHECKING:
    from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics

ROWS, COLUMNS = 7, 7
"""Positions looked at, from the base outwards and from side to side."""
LOW, HIGH = 0.1, 0.35
"""Heights of the tool from above and from the front, in parts of the arm's length."""
LITTLE = 0.05
"""Share of the positions from above below which hardly anything can be reached."""
ALONG = 0.7
"""Cosine from which on the way in which the hand closes at rest lies along an approach."""
_POSTURES = 2000


def check_reach(kinematics: PinocchioKinematics, report: Report) -> Array:
    """Draw a map of what is reached; nothing is an error, little a warning.

    Args:
        kinematics: Of the robot.
        report: Where the map and findings go.

    Returns:
        The postures ``(n, n_arm)`` that reach the map's positions.
    """
    robot = kinematics.robot
    drawn = np.random.default_rng(0).uniform(robot.arm_lower, robot.arm_upper, (_POSTURES, len(robot.rest)))
    length = float(np.quantile(np.linalg.norm(kinematics.forward(drawn)[:, :2], axis=-1), 0.98))
    tool = kinematics.forward(robot.rest)
    ahead = poses.yaw(math.atan2(tool[1], tool[0]))
    far, side = np.linspace(0.15, 1.0, ROWS) * length, np.linspace(0.6, -0.6, COLUMNS) * length
    grid = np.array([(x, y, 0.0) for x in far for y in side])
    above, high = (grid + np.array([0.0, 0.0, height * length]) for height in (LOW, HIGH))
    places = [poses.rotate(ahead[None], p) for p in (above, high)]
    down = np.array([0.0, 0.0, -1.0])
    outwards = places[1] * (1.0, 1.0, 0.0)
    ways = [np.tile(down, (len(grid), 1)), outwards / np.linalg.norm(outwards, axis=-1, keepdims=True)]
    reached, postures = [], []
    for position, way in zip(places, ways, strict=True):
        joints, found = _reached(kinematics, position, way)
        reached.append(found)
        postures.append(joints[found])
    radius = np.linalg.norm(grid[:, :2], axis=-1)
    report.seen += [
        _line("from above", LOW * length, reached[0], radius),
        _line("from the front", HIGH * length, reached[1], radius),
        *_map(reached[0], reached[1], far, side),
        f"       ahead is where the tool is at rest, x {tool[0]:.2f} y {tool[1]:.2f} m",
    ]
    if not reached[0].any() and not reached[1].any():
        what = "reaches nothing in front of its base, neither from above nor from the front"
        remedy = "see tool.pose, base_link and task_mask"
        report.add(ERROR, robot.name, "tool", what, remedy)
    elif np.mean(reached[0] | reached[1]) < LITTLE:
        what = f"is brought to {np.sum(reached[0] | reached[1])} of {len(grid)} places before the base"
        report.add(WARNING, robot.name, "tool", what, "see tool.pose, arm.rest and task_mask")
    return np.concatenate(postures)


def _reached(kinematics: PinocchioKinematics, position: Array, approach: Array) -> tuple[Array, Array]:
    """Joints ``(n, n_arm)``, and booleans ``(n,)``: with one of four turns about the approach it works."""
    from bt_tasksim.engines.kinematics.batch import BatchKinematics

    robot, n = kinematics.robot, len(position)
    heading = np.array([poses.yaw(math.atan2(p[1], p[0])) for p in position])
    closing = poses.rotate(heading, robot.closing)
    along = np.abs(poses.dot(closing, approach)) > ALONG
    closing[along] = poses.cross(approach[along], np.array([0.0, 0.0, 1.0]))
    neutral = poses.frame_from_axes(approach, closing)
    joints, found = np.tile(robot.rest, (n, 1)), np.zeros(n, bool)
    for turn in (0.0, math.pi / 2, math.pi, -math.pi / 2):
        left = np.flatnonzero(~found)
        if not len(left):
            break
        rotation = poses.quat_multiply(neutral[left], poses.yaw(turn)[None])
        asked = np.concatenate([position[left], rotation], axis=-1)
        q, failures = BatchKinematics.of(robot, len(left)).joints_at(asked)
        good = ~failures.mask
        joints[left[good]], found[left[good]] = q[good], True
    return joints, found


def _line(how: str, height: float, reached: Array, radius: Array) -> str:
    share = f"reach  {how}, tool {height:.2f} m high: {100 * np.mean(reached):.0f} % of the map"
    if not reached.any():
        return share
    near, far = radius[reached].min(), radius[reached].max()
    return f"{share}, {near:.2f} to {far:.2f} m from the base"


def _map(above: Array, ahead: Array, far: Array, side: Array) -> list[str]:
    """The map as lines: the base is below it, its left on the left."""
    signs = np.where(above & ahead, "#", np.where(above, "v", np.where(ahead, ">", ".")))
    rows = signs.reshape(len(far), len(side))
    return [
        f"       # both, v from above, > from the front; {side[0]:.2f} m to the left until "
        f"{-side[-1]:.2f} m to the right",
        *(f"       {far[k]:.2f} m ahead  {' '.join(rows[k])}" for k in reversed(range(len(far)))),
    ]
