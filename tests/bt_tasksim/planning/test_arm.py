"""An arm for planning: joints lead to the pose, within limits, without jumps, and as the engine's arm has
it."""

import copy
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.planning.arm import arm_of
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.robot.kinematics.chain import Chain, poses_of
from bt_tasksim.robot.kinematics.models import arm_model


def test_it_is_made_once_for_a_robot(panda):
    assert arm_of(panda.robot) is panda.arm


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_joints_found_lead_to_the_pose_within_limits(each, seed):
    robot, arm = each.robot, each.arm
    rng = np.random.default_rng(seed)
    there = np.clip(
        robot.rest + rng.normal(scale=0.3, size=len(robot.rest)), robot.arm_lower, robot.arm_upper
    )
    target = arm.tool(there)
    joints = arm.joints(target, robot.rest)
    if joints is None:
        return
    assert (joints >= robot.arm_lower).all() and (joints <= robot.arm_upper).all()
    found = arm.tool(joints)
    assert np.allclose(found[:3], target[:3], atol=1e-3)
    if robot.task_mask.all():
        assert poses.angle_between(found[3:], target[3:]) < 1e-3


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_postures_end_within_the_limits_so_that_there_is_something_left(each, seed):
    """Wherever it begins, at a limit too; but for joints that hardly move at all."""
    robot, arm = each.robot, each.arm
    rng = np.random.default_rng(seed)
    start = np.clip(rng.normal(robot.rest, 1.0), robot.arm_lower, robot.arm_upper)
    there = np.clip(rng.normal(start, 0.1), robot.arm_lower, robot.arm_upper)
    joints = arm.joints(arm.tool(there), start)
    if joints is None:
        return
    left = np.minimum(0.02, (robot.arm_upper - robot.arm_lower) / 4)
    assert (joints >= robot.arm_lower + left - 1e-9).all() and (joints <= robot.arm_upper - left + 1e-9).all()


def test_most_poses_near_rest_are_found(each):
    robot, arm = each.robot, each.arm
    rng = np.random.default_rng(1)
    asked = np.clip(
        robot.rest + rng.normal(scale=0.2, size=(40, len(robot.rest))), robot.arm_lower, robot.arm_upper
    )
    assert sum(arm.joints(tool, robot.rest) is not None for tool in arm.tools(asked)) >= 36


def test_out_of_reach_is_none(each):
    assert each.arm.joints(each.pose(3.0, 0.0, 0.3), each.robot.rest) is None
    assert each.arm.along(each.robot.rest, each.pose(3.0, 0.0, 0.3)[None]) is None


def test_along_a_line_no_joint_jumps(panda):
    start = panda.posture(0.45, -0.2, 0.4)
    tools = np.array([panda.pose(0.45, y, 0.4) for y in np.linspace(-0.18, 0.2, 20)])
    joints = panda.arm.along(start, tools)
    assert np.abs(np.diff(np.concatenate([start[None], joints]), axis=0)).max() < 0.2
    assert np.allclose(panda.arm.tools(joints)[:, :3], tools[:, :3], atol=1e-3)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_a_supple_posture_moves_its_tool_so_far_in_every_direction(each, seed):
    """What the tool goes for small motions of the joints, by differences, in many directions."""
    robot, arm = each.robot, each.arm
    rng = np.random.default_rng(seed)
    joints = rng.uniform(robot.arm_lower, robot.arm_upper)
    step = 1e-5 * np.eye(len(joints))
    moved = (arm.tools(joints + step)[:, :3] - arm.tools(joints - step)[:, :3]) / 2e-5
    directions = rng.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    goes = np.linalg.norm(directions @ moved.T, axis=1)
    least = float(arm.supple(joints[None])[0])
    assert (goes >= least - 1e-5).all() and goes.min() <= least + 0.1


def test_a_line_that_leaps_cannot_be_followed(panda):
    start = panda.posture(0.45, -0.4, 0.4)
    assert panda.arm.along(start, panda.pose(0.45, 0.4, 0.4)[None]) is None


def test_no_answer_depends_on_the_one_before(panda):
    first = panda.posture(0.5, 0.1, 0.3)
    panda.posture(0.3, -0.3, 0.5)
    assert np.array_equal(panda.posture(0.5, 0.1, 0.3), first)


def test_its_tool_is_where_the_batched_kinematics_has_it(each):
    robot = each.robot
    q = np.random.default_rng(0).uniform(robot.arm_lower, robot.arm_upper, (5, len(robot.rest)))
    chain = Chain.of(arm_model(robot, bodies_of(robot).model), "tool", q)
    tools = poses_of(chain.seen(np.ascontiguousarray(q.T))[0])
    assert np.allclose(tools[:, :3], each.arm.tools(q)[:, :3], atol=1e-9)
    assert poses.angle_between(tools[:, 3:], each.arm.tools(q)[:, 3:]).max() < 1e-6


def test_threads_do_not_write_into_one_another(each):
    robot, arm = each.robot, each.arm
    rng = np.random.default_rng(0)
    near = robot.rest + rng.normal(scale=0.2, size=(60, len(robot.rest)))
    targets = [arm.tool(np.clip(q, robot.arm_lower, robot.arm_upper)) for q in near]

    def solved(target):
        joints = arm.joints(target, robot.rest)
        return None if joints is None else joints.tolist()

    alone = [solved(target) for target in targets]
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            assert list(pool.map(solved, targets)) == alone
    finally:
        sys.setswitchinterval(usual)


def test_a_copied_robot_has_an_arm_too(panda):
    assert panda.robot.derived("what no copy can have", lambda robot: threading.Lock())
    again = copy.deepcopy(panda.robot)
    at = arm_of(panda.robot).tool(panda.robot.rest)
    assert np.array_equal(arm_of(again).tool(again.rest), at)


def test_who_asks_again_gets_the_same_and_may_change_it(each):
    robot, arm = each.robot, each.arm
    tool = poses.shifted(arm.tool(robot.rest), np.array([0.01, 0.0, -0.02]))
    far = poses.shifted(tool, np.array([3.0, 0.0, 0.0]))
    first = arm.joints(tool, robot.rest)
    kept = first.copy()
    first += 1.0
    np.testing.assert_array_equal(arm.joints(tool, robot.rest), kept)
    for other in (arm, copy.copy(arm), copy.deepcopy(arm)):
        # Copies lie elsewhere in memory, and sums may round so.
        np.testing.assert_allclose(other.joints(tool, robot.rest), kept, atol=1e-4)
        assert other.joints(far, robot.rest) is None is other.joints(far, robot.rest)
