"""Whether a robot's tool frame lies in its hand as it should, and its limits fit its URDF."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.urdf_links import joint_limits, joint_speeds

if TYPE_CHECKING:
    from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics

CLOSURES = np.linspace(0.0, 1.0, 9)
"""Closures at which a hand is looked at."""
NEAR, FAR = 0.02, 0.05
"""Metres from the tool's origin to the middle between the fingers: what is well, and what is wrong."""
ASKEW, ACROSS = math.radians(30.0), math.radians(60.0)
"""Angles between the way in which the fingers close and the tool's y: what is well, and what is wrong."""
WIDE, WRONG = 0.15, 0.5
"""Relative errors of the stated opening: what is well, and what is wrong."""
FORWARDS = 0.5
"""Least share of the way from the wrist to the tool that lies along the tool's z."""
MARGIN = 0.05
"""Radians that a rest posture should keep from every limit."""
TURNED = math.radians(45.0)
"""Angle between ``tool.closing`` and how the hand closes at rest, from which on it is a mistake."""


def fingers(kinematics: PinocchioKinematics, closure: float) -> Array:
    """Middles ``(n_groups, 3)`` of the groups of tips that face each other, tool frame, at a closure."""
    robot = kinematics.robot
    hand = robot.hand_position(np.array([closure] + [0.0] * len(robot.synergies)))
    joints = np.concatenate([robot.rest, hand])
    local = poses.localise(kinematics.forward(joints), kinematics.tips(joints))
    return np.array([local[list(group)].mean(axis=0) for group in robot.opposition])


def check_frames(kinematics: PinocchioKinematics, report: Report) -> None:
    """The tool's z leads out of the hand, the fingers close along its y about its origin, as wide as stated.

    Args:
        kinematics: Of the robot.
        report: Where findings go.
    """
    robot = kinematics.robot
    _check_approach(kinematics, report)
    groups = np.array([fingers(kinematics, float(c)) for c in CLOSURES])
    across = groups[:, 1] - groups[:, 0]
    gaps = np.linalg.norm(across, axis=-1)
    middle = np.linalg.norm(groups.mean(axis=1), axis=-1)
    report.seen.append(
        f"hand   opens to {1000 * gaps[0]:.0f} mm between the tips, closes to {1000 * gaps.min():.0f} mm"
    )
    if gaps[0] <= gaps[-1]:
        what = f"is wider apart closed ({1000 * gaps[-1]:.0f} mm) than open ({1000 * gaps[0]:.0f} mm)"
        report.add(ERROR, robot.name, "hand.closed", what, "swap hand.open and hand.closed")
    _check_middle(robot, float(middle.min()), report)
    open_wide = gaps > max(0.01, 0.2 * float(gaps[0]))
    turns = np.arccos(np.clip(np.abs(across[open_wide, 1]) / gaps[open_wide], 0.0, 1.0))
    if len(turns) and (turned := float(turns.min())) > ASKEW:
        what = f"is turned {math.degrees(turned):.0f} degrees from the line along which the fingers close"
        remedy = "turn tool.pose about its z, so that its y runs from finger to finger"
        report.add(ERROR if turned > ACROSS else WARNING, robot.name, "tool.pose", what, remedy)
    error = abs(robot.opening - float(gaps[0])) / max(float(gaps[0]), 1e-9)
    if error > WIDE:
        what = f"says {1000 * robot.opening:.0f} mm, and the open tips are {1000 * gaps[0]:.0f} mm apart"
        report.add(
            ERROR if error > WRONG else WARNING, robot.name, "opening", what,
            "measure between the pads, and put the points of 'tips' in their middles",
        )  # fmt: skip


def _check_approach(kinematics: PinocchioKinematics, report: Report) -> None:
    robot = kinematics.robot
    joints = np.concatenate([robot.rest, robot.hand_open])
    tool = kinematics.forward(joints)
    wrist = poses.localise(tool, kinematics.link_poses(joints, [robot.wrist_link])[robot.wrist_link][:3])
    away = float(np.linalg.norm(wrist))
    if away > 0.01 and -float(wrist[2]) < FORWARDS * away:
        back = wrist[2] > 0.0
        what = f"has a z that {'leads back to' if back else 'runs across the way from'} the wrist"
        remedy = "turn tool.pose, so that its z is the direction in which the hand comes to a thing"
        report.add(ERROR if back else WARNING, robot.name, "tool.pose", what, remedy)
    heading = poses.yaw(math.atan2(tool[1], tool[0]))
    along = poses.rotate(heading, robot.closing) @ poses.rotate(tool[3:], np.array([0.0, 1.0, 0.0]))
    turned = math.acos(min(1.0, abs(float(along))))
    if turned > TURNED:
        what = f"is {math.degrees(turned):.0f} degrees from the line along which the hand closes at rest"
        remedy = "give the direction of the tool's y at rest, as if the tool were straight ahead on x"
        report.add(WARNING, robot.name, "tool.closing", what, remedy)


def _check_middle(robot: RobotDescription, middle: float, report: Report) -> None:
    """The point between the fingers, where a thing is held, is the tool's origin."""
    if middle > NEAR:
        what = f"has its origin {1000 * middle:.0f} mm from where the fingers meet, however far they close"
        remedy = "put it half way between the tips when they hold something"
        report.add(ERROR if middle > FAR else WARNING, robot.name, "tool.pose", what, remedy)


def check_workspace(kinematics: PinocchioKinematics, report: Report) -> None:
    """The tool of an arm at rest is in the workspace of its safety limits, if it has any.

    Args:
        kinematics: Of the robot.
        report: Where findings go.
    """
    robot = kinematics.robot
    if robot.safety is None:
        return
    tool = kinematics.forward(np.concatenate([robot.rest, robot.hand_open]))[:3]
    if not robot.safety.in_workspace(tool):
        at = ", ".join(f"{x:.2f}" for x in tool)
        what = f"does not hold the tool at rest, at ({at}) m: the robot would be stopped at once"
        report.add(
            ERROR, robot.name, "safety.workspace", what, "make the box larger, or take another arm.rest"
        )


def check_limits(robot: RobotDescription, report: Report) -> None:
    """The arm's limits are those of its URDF, and it rests away from them.

    Args:
        robot: The robot.
        report: Where findings go.
    """
    limits, speeds = joint_limits(robot.urdf), joint_speeds(robot.urdf)
    rows = zip(robot.arm_joints, robot.arm_lower, robot.arm_upper, robot.rest, strict=True)
    for joint, lower, upper, rest in rows:
        span = float(upper - lower)
        full = limits.get(joint)
        if full is not None and span < 0.5 * (full[1] - full[0]):
            what = f"leaves joint '{joint}' {span:.2f} of the {full[1] - full[0]:.2f} rad that its URDF has"
            report.add(WARNING, robot.name, "arm.lower", what, "give radians, and the joint's whole range")
        if min(rest - lower, upper - rest) < MARGIN:
            what = f"puts joint '{joint}' at {rest:.2f} rad, at its limit"
            report.add(WARNING, robot.name, "arm.rest", what, "choose a posture in the middle of the range")
    for joint, velocity in zip(robot.arm_joints, robot.arm_velocity, strict=True):
        if velocity > 1.05 * speeds.get(joint, math.inf):
            what = f"lets joint '{joint}' turn at {velocity:.2f} rad/s, its URDF at {speeds[joint]:.2f}"
            report.add(WARNING, robot.name, "arm.velocity", what, "take the slower of the two")
