"""Hands that press with a force of their own once told to shut, as grippers with force control do."""

from __future__ import annotations

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.robot.description import RobotDescription


def shutting(robot: RobotDescription, position: Array, measured: Array) -> Array:
    """Where drives are to go, so that a hand that is told to shut presses.

    A drive that is told to be where a hand is shut presses on a thing of 6 mm with no more than what its
    spring gives for 3 mm. A gripper with force control presses as hard on a thin thing as on a thick one: its
    drive is told to go at least so far beyond where the joint is that its spring gives that force.

    Args:
        robot: The robot; where it has no `RobotDescription.hand_press` nothing changes.
        position: Where the drives are told to go ``(N, n_joints)``.
        measured: Where the joints are ``(N, n_joints)``.
    """
    if not robot.hand_press:
        return position
    n_arm = len(robot.arm_joints)
    way = np.sign(robot.hand_closed - robot.hand_open)
    stiffness = robot.drive_array("stiffness")[n_arm:]
    to, at = position[:, n_arm:], measured[:, n_arm:]
    beyond = at + way * robot.hand_press / stiffness
    pressing = (way != 0.0) & (abs(to - robot.hand_closed) < 1e-9) & (way * beyond > way * to)
    found: Array = np.concatenate([position[:, :n_arm], np.where(pressing, beyond, to)], axis=1)
    return found
