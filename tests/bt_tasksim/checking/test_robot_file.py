"""A robot is checked against its URDF and in physics: what is sound passes, each mistake is named."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import yaml

from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.checking.robot_drives import check_drives
from bt_tasksim.checking.robot_file import check_robot
from bt_tasksim.checking.robot_frames import check_frames, check_limits, check_workspace
from bt_tasksim.checking.robot_reach import check_reach
from bt_tasksim.checking.robot_touching import check_touching
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.robot.description import load_robot
from tests.bt_tasksim import small_arm

SOFT = {"stiffness": 0.5, "damping": 5.0, "force_limit": 0.5}


@pytest.fixture
def small(tmp_path):
    """Makes a small arm whose file says something else than it should."""

    def make(**changes):
        small_arm.write(tmp_path)
        data = small_arm.data("base")
        for field, value in changes.items():
            *above, last = field.split("__")
            at = data
            for key in above:
                at = at[key]
            at[last] = value
        file = tmp_path / "small.yaml"
        file.write_text(yaml.safe_dump(data))
        return str(file)

    return make


@pytest.mark.parametrize("robot", ["panda", "so100"])
def test_bundled_robots_have_no_errors_and_show_a_map(robot):
    report = check_robot(robot)
    assert not report.findings, report.lines()
    assert sum(" m ahead " in line for line in report.seen) == 7
    assert report.lines()[-1].startswith(f"ok: robot {robot}, an arm of ")


@pytest.mark.parametrize(
    ("changes", "level", "where", "what"),
    [
        ({"hand__open": [0.0] * 2, "hand__closed": [0.04] * 2}, ERROR, "hand.closed", "wider apart closed"),
        ({"opening": 0.2}, ERROR, "opening", "says 200 mm, and the open tips are 80 mm apart"),
        ({"opening": 0.095}, WARNING, "opening", "says 95 mm"),
        ({"tool__pose": [0, 0, 0.1, 0, 0, 1, 0]}, ERROR, "tool.pose", "leads back to the wrist"),
        ({"tool__pose": [0, 0, 0.1, 0.70710678, 0, 0, 0.70710678]}, ERROR, "tool.pose", "90 degrees"),
        ({"tool__pose": [0, 0, 0.18, 1, 0, 0, 0]}, ERROR, "tool.pose", "100 mm from where the fingers meet"),
        ({"tool__closing": [1, 0, 0]}, WARNING, "tool.closing", "degrees from the line"),
        ({"arm__rest": [0.3, 2.98, 0.8, 0.1, 0.7, 0.2]}, WARNING, "arm.rest", "at 2.98 rad, at its limit"),
        ({"arm__velocity": [2.0, 3.0, 2, 2, 2, 2]}, WARNING, "arm.velocity", "'j1' turn at 3.00 rad/s"),
        ({"arm__upper": [3.0, 0.6, 3, 3, 3, 3], "arm__lower": [-3.0, 0.1, -3, -3, -3, -3]}, WARNING,
         "arm.lower", "leaves joint 'j1' 0.50 of the 6.00 rad"),
    ],
)  # fmt: skip
def test_a_mistake_in_frames_and_limits_is_named(small, changes, level, where, what):
    robot, report = load_robot(small(**changes)), Report()
    check_frames(PinocchioKinematics(robot), report)
    check_limits(robot, report)
    found = [f for f in report.findings if f.function == where]
    assert [f.level for f in found] == [level] and what in found[0].what, report.lines()


def test_a_sound_arm_has_neither(small):
    robot, report = load_robot(small()), Report()
    check_frames(PinocchioKinematics(robot), report)
    check_limits(robot, report)
    assert not report.findings, report.lines()


def test_postures_of_the_map_bring_the_tool_where_they_should(small):
    kinematics, report = PinocchioKinematics(load_robot(small())), Report()
    postures = check_reach(kinematics, report)
    tools = kinematics.forward(postures)
    assert len(postures) > 20 and len(np.unique(np.round(tools[:, 2], 2))) == 2, "two heights"
    fixed = small(arm__lower=[-0.01] * 6, arm__upper=[0.01] * 6, arm__rest=[0.0] * 6)
    report = Report()
    assert len(check_reach(PinocchioKinematics(load_robot(fixed)), report)) == 0
    assert [f.level for f in report.findings] == [ERROR] and "reaches nothing" in report.findings[0].what


def test_a_rest_posture_in_which_links_meet_is_an_error(small):
    folded = [0.0, np.pi / 2, np.pi / 2, 0.0, np.pi / 2, 0.0]  # the hand is at the base
    kinematics = PinocchioKinematics(load_robot(small(arm__rest=[float(q) for q in folded])))
    report = Report()
    check_touching(kinematics, np.array([kinematics.robot.rest] * 3), report)
    levels = {f.level: f for f in report.findings}
    assert "mm into" in levels[ERROR].what and levels[ERROR].function == "arm.rest"
    assert "3 of 3 postures" in levels[WARNING].what
    report = Report()
    kinematics = PinocchioKinematics(load_robot(small()))
    check_touching(kinematics, kinematics.robot.rest[None], report)
    assert not report.findings


def test_kinematics_and_physics_that_differ_by_more_than_a_millimetre_are_an_error():
    robot = load_robot("panda")
    off = robot.tool_pose + np.array([0.0, 0.0, 0.0015, 0.0, 0.0, 0.0, 0.0])
    report = Report()
    check_drives("panda", PinocchioKinematics(dataclasses.replace(robot, tool_pose=off)), report)
    assert [(f.level, f.function) for f in report.findings] == [(ERROR, "base_link")]
    assert "1.5 mm off in physics" in report.findings[0].what


@pytest.mark.parametrize(
    ("changes", "where", "what"),
    [
        ({"arm__drive": SOFT}, "arm.drive", "from where it was sent"),
        ({"hand__drive": SOFT | {"stiffness": 0.01, "damping": 0.0}}, "hand.drive", "moves its tips from"),
    ],
)
def test_drives_that_are_too_weak_are_named(small, changes, where, what):
    robot, report = small(**changes), Report()
    check_drives(robot, PinocchioKinematics(load_robot(robot)), report)
    found = [f for f in report.findings if f.function == where]
    assert found and what in found[0].what, report.lines()


def test_a_workspace_that_does_not_hold_the_resting_tool_is_an_error():
    robot = load_robot("panda")
    for x, errors in ((0.85, 0), (0.1, 1)):
        workspace = np.array([robot.safety.workspace[0], [x, *robot.safety.workspace[1][1:]]])
        safety, report = dataclasses.replace(robot.safety, workspace=workspace), Report()
        check_workspace(PinocchioKinematics(dataclasses.replace(robot, safety=safety)), report)
        assert report.errors == errors
        assert all(finding.function == "safety.workspace" for finding in report.findings)
