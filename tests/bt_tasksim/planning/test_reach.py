"""How near an arm comes to tool poses, without looking for joints."""

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.planning.arm import arm_of
from bt_tasksim.planning.reach import reach_of
from bt_tasksim.robot.description import load_robot

HIGH_AND_FAR = [0.52, -0.46, 0.80]
"""Where the arm reaches level and ahead, and not from above: its wrist would be higher than it comes."""


@pytest.fixture(scope="module")
def robot():
    return load_robot("xarm7_ability")


def test_where_the_arm_can_be_it_is_near_and_elsewhere_it_is_far(robot):
    rng = np.random.default_rng(7)
    drawn = rng.uniform(robot.arm_lower, robot.arm_upper, (200, len(robot.arm_joints)))
    there = np.array([arm_of(robot).tool(q) for q in drawn])
    away = there * [2.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    beyond = np.hypot(away[:, 0], away[:, 1]) > 1.1
    far = reach_of(robot).far
    assert np.quantile(far(there), 0.9) < np.quantile(far(away[beyond]), 0.1)


@pytest.mark.parametrize("name", ["panda", "xarm7_ability", "so100"])
def test_what_it_says_to_be_beyond_reach_is(name):
    """Hardly any posture is, and no pose for which joints are found at the edge of what the arm reaches."""
    robot, rng = load_robot(name), np.random.default_rng(11)
    arm, reach = arm_of(robot), reach_of(robot)
    lower, upper = np.maximum(robot.arm_lower, -np.pi), np.minimum(robot.arm_upper, np.pi)
    there = arm.tools(rng.uniform(lower, upper, (1000, len(robot.arm_joints))))
    assert np.mean(reach.beyond(there)) < 0.005
    edge = float(np.hypot(there[:, 0], there[:, 1]).max())
    tools, found = [], []
    for _ in range(150):
        bearing, lean, away = rng.uniform([-0.8, 0.0, 0.8 * edge], [0.8, 1.2, 1.4 * edge])
        approach = np.array([np.sin(lean) * np.cos(bearing), np.sin(lean) * np.sin(bearing), -np.cos(lean)])
        side = np.array([-np.sin(bearing), np.cos(bearing), 0.0])
        at = [away * np.cos(bearing), away * np.sin(bearing), 0.15 * edge]
        tools.append(np.concatenate([at, poses.frame_from_axes(approach, side)]))
        found.append(any(arm.joints(tools[-1], seed) is not None for seed in (robot.rest, *arm.seeds)))
    beyond = reach.beyond(np.array(tools), 0.12)
    assert not (beyond & found).any() and beyond.mean() > 0.3


def test_a_turn_of_the_first_joint_makes_no_difference(robot):
    tool = poses.pose(
        [0.4, 0.1, 0.3], poses.frame_from_axes(np.array([0.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0]))
    )
    turned = poses.multiply(poses.pose([0.0, 0.0, 0.0], poses.yaw(1.1)), tool)
    assert reach_of(robot).far(turned[None]) == pytest.approx(reach_of(robot).far(tool[None]), abs=1e-6)


def test_it_says_from_where_the_arm_comes_to_what_is_high_and_far(robot):
    bearing = np.arctan2(HIGH_AND_FAR[1], HIGH_AND_FAR[0])
    ahead, aside = (np.array([np.cos(b), np.sin(b), 0.0]) for b in (bearing, bearing + np.pi / 2))
    down = np.array([0.0, 0.0, -1.0])
    found = {
        name: min(
            float(reach_of(robot).far(poses.pose(HIGH_AND_FAR, poses.frame_from_axes(along, axis))[None])[0])
            for axis in (aside, -aside)
        )
        for name, along in (("level", ahead), ("above", down))
    }
    assert found["level"] < found["above"]
