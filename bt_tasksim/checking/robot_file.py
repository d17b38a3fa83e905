"""``bt-tasksim check`` of a robot: is the arm the one that its file describes, and what can it reach?"""

from __future__ import annotations

from bt_tasksim.checking.report import Report
from bt_tasksim.checking.robot_drives import check_drives
from bt_tasksim.checking.robot_frames import check_frames, check_limits, check_workspace
from bt_tasksim.checking.robot_reach import check_reach
from bt_tasksim.checking.robot_touching import check_touching
from bt_tasksim.robot.description import load_robot


def check_robot(robot: str) -> Report:
    """Check a robot: its frames and limits, what it reaches, whether it hits itself, and its drives.

    The drives are looked at in SAPIEN; everything else comes from the URDF.

    Args:
        robot: Its name, or the path of its file.

    Raises:
        InputError: The file or its URDF cannot be read.
        MachineError: The physics engine is not installed.
    """
    from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics

    found = load_robot(robot)
    kinematics, report = PinocchioKinematics(found), Report()
    check_frames(kinematics, report)
    check_limits(found, report)
    check_workspace(kinematics, report)
    postures = check_reach(kinematics, report)
    check_touching(kinematics, postures, report)
    check_drives(robot, kinematics, report)
    arm, hand = len(found.arm_joints), len(found.hand_joints)
    report.done(
        f"robot {found.name}, an arm of {arm} joints and a hand of {hand}: frames, limits, reach, "
        f"{len(postures)} postures, drives"
    )
    return report
