"""What a learned grasp looks at, and how its actions change the reference motion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim import poses
from bt_tasksim.context import Seen
from bt_tasksim.poses import Array, array_namespace, constant
from bt_tasksim.robot import RobotDescription

if TYPE_CHECKING:
    from concept_nodes.grasp import GraspMemory

SIDE, ACROSS, ALONG, TURN, CLOSE, PACE = range(6)
ACTIONS = ("aside", "across the fingers", "along the approach", "turn about the approach", "close", "pace")
"""The first five are offsets from the reference motion; the last one is that motion's pace, see `delay`."""
CAREFUL, WITHDRAWS = 0.25, -0.5
"""Paces, of the reference motion's own, that the middle of an action stands for: a slow approach, in which a
first contact can be felt before it presses hard, and the way back, while a finger stands on something."""
OBSTRUCTED = 0.0015
"""Metres by which a hand that touches something is held up along the approach: it stands on it. Measured:
-2 to 1 mm at the instant of a first contact at `CAREFUL` pace, 2 to 6 mm one control period later."""
SCALE = (0.015, 0.025, 0.035, 0.25, 0.5)
"""Largest offsets: metres along the tool's x (aside), y (the fingers' closing axis) and z (the approach),
radians about z, and of the hand's closure. Source of their order: the released original's grasp training,
which has 0.03 m, 0.01 m and 0.35 rad; the sides are wider here for estimates that are 8 mm off."""
RATE = (0.004, 0.005, 0.006, 0.04, 0.15)
"""Largest change of these offsets in a control period of 50 ms: exploring actions do not shake the arm."""
PERIOD = 0.05
"""Seconds that `RATE` refers to."""


def layout(robot: RobotDescription) -> dict[str, int]:
    """Names and sizes of the features for a robot."""
    n_hand, n_tips = len(robot.hand_joints), len(robot.tips)
    return {
        "tool from grasp pose": 4,
        "tool behind its target": 3,
        "offsets": 5,
        "hand joints": n_hand,
        "closing speed": 1,
        "contacts": n_tips,
        "contacts so far": n_tips,
        "first contact along the approach": 1,
        "time": 4,
        "estimate": 5,
        "object pushed": 3,
    }


def features(seen: Seen, memory: GraspMemory) -> Array:
    """The features ``(..., n)``, all of the order of one."""
    local = poses.multiply(poses.inverse(memory.goal), seen.tool)
    turn = poses.rotation_vector(local[..., 3:])[..., 2:]
    behind = poses.transform(poses.inverse(memory.target), seen.tool[..., :3])
    pushed = poses.rotate(
        poses.quat_conjugate(memory.goal[..., 3:]), memory.now[..., :3] - memory.start[..., :3]
    )
    robot = seen.robot
    opened, span = constant(robot.hand_open, seen.tool), constant(_span(robot), seen.tool)
    joints = (seen.observation.hand_position - opened) / span
    numbers = (
        (seen.closure - memory.closure) / 0.1,
        memory.first / 0.03,
        poses.clip(seen.elapsed - memory.delay - memory.path.duration, -1.0, 2.0),
        poses.clip(memory.delay, 0.0, 4.0),
        poses.clip(memory.closing, -0.1, 2.0),
        poses.clip(memory.settled / 3.0, 0.0, 2.0),
    )
    if type(seen.tool) is np.ndarray and seen.tool.ndim == 1:
        rest = numbers
        parts = [
            local[:3] / 0.03, turn / 0.2, behind / 0.01, memory.offset / _SCALE, joints, rest[:1],
            seen.contacts, memory.touched, rest[1:], memory.estimate, pushed / 0.01,
        ]  # fmt: skip
        return np.concatenate(parts)
    xp = array_namespace(seen.tool)
    columns = [xp.astype(n, seen.tool.dtype)[..., None] for n in numbers]
    parts = [
        local[..., :3] / 0.03,
        turn / 0.2,
        behind / 0.01,
        memory.offset / constant(SCALE, seen.tool),
        joints,
        columns[0],
        xp.astype(seen.contacts, seen.tool.dtype),
        memory.touched,
        *columns[1:],
        memory.estimate,
        pushed / 0.01,
    ]
    return xp.concat(parts, axis=-1)


def moved_offset(action: Array, memory: GraspMemory, period: float) -> Array:
    """The offsets ``(..., 5)`` one control period on: towards the action, no faster than `RATE`.

    They grow with the square of the action: around its middle a hand that should go straight does, to within
    a fraction of a millimetre, and is not led astray by exploration either.
    """
    asked = poses.clip(action[..., :PACE], -1.0, 1.0)
    action = asked * abs(asked) + memory.middle
    if type(action) is np.ndarray:
        step = _RATE * (period / PERIOD)
        gap = action * _SCALE - memory.offset
        return memory.offset + np.minimum(np.maximum(gap, -step), step)
    gap = action * constant(SCALE, memory.offset) - memory.offset
    step = constant(RATE, memory.offset) * (period / PERIOD)
    return memory.offset + poses.clip(gap, -step, step)


def delay(action: Array, seen: Seen, memory: GraspMemory) -> Array:
    """Seconds ``(...)`` by which the reference motion falls behind within a control period.

    None before the straight approach. Then the pace is 1 for an action of 1, and for the middle one
    `CAREFUL`, or `WITHDRAWS` while the open hand stands on something; never below -1, and never back beyond
    where the straight approach began.
    """
    xp = array_namespace(memory.delay)
    period = seen.world.control_period
    ahead = poses.transform(poses.inverse(memory.target), seen.tool[..., :3])[..., 2]
    touching = xp.any(xp.astype(seen.contacts, xp.bool), axis=-1)
    stands = touching & (ahead < -OBSTRUCTED) & (memory.closing < 0.0)
    middle = xp.where(stands, WITHDRAWS, CAREFUL)
    pace = poses.clip(middle + (1.0 - middle) * action[..., PACE], -1.0, 1.0)
    within = seen.elapsed - memory.delay - memory.begins
    return xp.where(within >= 0.0, xp.minimum(period * (1.0 - pace), within + period), 0.0)


def displaced(reference: Array, offset: Array) -> Array:
    """Tool poses ``(..., 7)`` on the reference motion, moved by offsets ``(..., 5)`` in the tool's frame."""
    if type(offset) is np.ndarray and offset.ndim == 1:
        x, y, z, turn, _ = offset.tolist()
        if abs(x) + abs(y) + abs(z) + abs(turn) < _NOTHING:
            return reference
        return poses.multiply(
            reference, np.array([x, y, z, math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2)])
        )
    xp = array_namespace(reference)
    half = offset[..., TURN] / 2
    zero = xp.zeros_like(half)
    turn = xp.stack([xp.cos(half), zero, zero, xp.sin(half)], axis=-1)
    return poses.multiply(reference, xp.concat([offset[..., :3], turn], axis=-1))


_NOTHING = 1e-12
_SCALE, _RATE = np.array(SCALE), np.array(RATE)


def _span(robot: RobotDescription) -> Array:
    """Range of each hand joint ``(n_hand,)``; 1 where it does not move."""
    span = robot.hand_closed - robot.hand_open
    return span + (span == 0.0)
