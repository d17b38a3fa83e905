"""Forward and inverse kinematics, and tracking: accuracy, limits, continuity, misses, the task mask."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, UnreachableError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Command, JointTarget, WorldState
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.robot.description import load_robot

PERIOD = 0.05
DOWN = poses.frame_from_axes(np.array([0.0, 0.0, -1.0]), np.array([0.0, -1.0, 0.0]))
AHEAD = poses.frame_from_axes(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
ALONG_X = np.eye(7)[0]
TURN = np.array([0.5, np.sqrt(0.5), 0.5, 0.0])  # half way from down to ahead, for places with y > 0


@cache
def engine(name: str) -> PinocchioKinematics:
    return PinocchioKinematics(load_robot(name), PERIOD)


def fresh(name: str) -> PinocchioKinematics:
    return PinocchioKinematics(load_robot(name), PERIOD)


def state(kinematics: PinocchioKinematics, arm: Array | None = None) -> WorldState:
    robot = kinematics.robot
    joints = np.concatenate([robot.rest if arm is None else arm, robot.hand_open])
    zero = np.zeros_like(joints)
    return WorldState(0.0, joints, zero, zero, None, None, None, None)


def joints_in(name: str, unit: Sequence[float]) -> Array:
    robot = load_robot(name)
    lower, upper = np.maximum(robot.arm_lower, -3.0), np.minimum(robot.arm_upper, 3.75)
    return lower + np.array(unit) * (upper - lower)


def line(points: Sequence[Array], step: float = 0.0075, turn: float = 0.05) -> list[Array]:
    """Poses along straight lines, at the steps of 0.15 m/s and 1 rad/s."""
    out = []
    for a, b in itertools.pairwise(points):
        n = int(max(np.linalg.norm(b[:3] - a[:3]) / step, poses.angle_between(a[3:], b[3:]) / turn, 1)) + 1
        out += [poses.interpolate(a, b, i / n) for i in range(1, n + 1)]
    return out


def track(kinematics: PinocchioKinematics, path: Sequence[Array], arm: Array | None = None) -> Array:
    first = state(kinematics, arm)
    return np.array([kinematics.solve(Command(tool=p), first).position for p in path])


def miss(a: Array, b: Array) -> tuple[float, float]:
    return (
        float(np.linalg.norm(a[..., :3] - b[..., :3], axis=-1).max()),
        float(np.max(poses.angle_between(a[..., 3:], b[..., 3:]))),
    )


def check_tracked(
    kinematics: PinocchioKinematics, joints: Array, path: Sequence[Array], margin: float, step: float
) -> None:
    distance, angle = miss(kinematics.forward(joints), np.array(path))
    assert distance < 1e-4
    assert angle < 1e-4
    check_limits(kinematics, joints, margin, step)


def check_limits(kinematics: PinocchioKinematics, joints: Array, margin: float, step: float) -> None:
    robot, n = kinematics.robot, len(kinematics.robot.arm_joints)
    arm = joints[:, :n]
    assert np.abs(np.diff(arm, axis=0)).max() < step
    assert np.minimum(arm - robot.arm_lower, robot.arm_upper - arm).min() > margin


@pytest.mark.parametrize("name", ["panda", "xarm7_ability"])
@settings(max_examples=60, deadline=None, derandomize=True)
@given(unit=st.lists(st.floats(0.02, 0.98), min_size=7, max_size=7))
def test_inverse_undoes_forward_within_limits(name: str, unit: list[float]) -> None:
    kinematics = engine(name)
    pose = kinematics.forward(joints_in(name, unit))
    found = kinematics.inverse(pose)
    assert np.all((found >= kinematics.robot.arm_lower) & (found <= kinematics.robot.arm_upper))
    distance, angle = miss(kinematics.forward(found), pose)
    assert distance < 1e-3  # what counts as reached; nearly always below 0.1 mm
    assert angle < 5e-3


@settings(max_examples=60, deadline=None, derandomize=True)
@given(unit=st.lists(st.floats(0.02, 0.98), min_size=5, max_size=5))
def test_task_mask_frees_one_rotation(unit: list[float]) -> None:
    kinematics = engine("so100")
    pose = kinematics.forward(joints_in("so100", unit))
    found = kinematics.forward(kinematics.inverse(pose))
    off = poses.multiply(poses.inverse(found), pose)
    assert np.abs(off[:3]).max() < 1e-3
    assert np.abs(poses.rotation_vector(off[3:])[[0, 2]]).max() < 5e-3


def test_five_joints_reach_what_six_numbers_ask() -> None:
    """Tool down at any heading lies in the arm's plane; a tool that leans out of it is missed freely."""
    kinematics = engine("so100")
    for x, heading in itertools.product((-0.1, 0.0, 0.1), (-0.7, 0.0, 0.7)):
        pose = np.array([x, -0.2, 0.05, *poses.quat_multiply(DOWN, poses.yaw(heading))])
        assert miss(kinematics.forward(kinematics.inverse(pose)), pose) < (1e-4, 2e-3)
    leaning = poses.quat_multiply(DOWN, poses.from_rotation_vector(np.array([0.0, 0.3, 0.0])))
    pose = np.array([0.0, -0.2, 0.05, *leaning])
    distance, angle = miss(kinematics.forward(kinematics.inverse(pose)), pose)
    assert distance < 1e-3
    assert 0.1 < angle < 0.5


def test_position_only_miss_is_the_true_distance() -> None:
    panda = load_robot("panda")
    kinematics = PinocchioKinematics(
        dataclasses.replace(panda, task_mask=np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
    )
    rng = np.random.default_rng(0)
    reach = kinematics.forward(rng.uniform(panda.arm_lower, panda.arm_upper, (20000, 7)))[:, :3]
    for goal in ([1.5, 0.0, 0.333], [0.9, 0.9, 0.9], [0.0, 0.0, 2.0]):
        with pytest.raises(UnreachableError) as error:
            kinematics.inverse(np.array([*goal, *DOWN]))
        sampled = float(np.linalg.norm(reach - np.array(goal), axis=1).min())
        assert error.value.distance <= sampled
        assert error.value.distance > sampled - 0.06
        assert f"{1000 * error.value.distance:.1f} mm" in str(error.value)
    # Stretched out sideways at shoulder height: by the lengths of Franka's data sheet.
    with pytest.raises(UnreachableError) as error:
        kinematics.inverse(np.array([1.5, 0.0, 0.333, *DOWN]))
    lengths = np.hypot(0.316, 0.0825) + np.hypot(0.384, 0.0825) + np.hypot(0.088, 0.107 + 0.1034)
    assert error.value.distance == pytest.approx(1.5 - lengths, abs=0.02)


def test_unreachable_pose_says_by_how_much() -> None:
    kinematics = engine("panda")
    near = kinematics.inverse(np.array([0.7, 0.0, 0.2, *DOWN]))
    assert near.shape == (7,)
    misses = []
    for x in (0.9, 1.0, 1.1):
        with pytest.raises(UnreachableError) as error:
            kinematics.inverse(np.array([x, 0.0, 0.2, *DOWN]))
        misses.append(error.value.distance)
        assert 0.0 < error.value.distance <= x - 0.7
        assert "cannot bring its tool to" in str(error.value)
    assert misses[0] < misses[1] < misses[2]


@pytest.mark.parametrize("quaternion", [[0, 0, 0, 0], [np.nan, 0, 0, 1], [5, 0, 0, 0]])
def test_pose_without_a_rotation_is_refused(quaternion: list[float]) -> None:
    with pytest.raises(InputError, match="unit quaternion"):
        engine("panda").inverse(np.array([0.5, 0.0, 0.2, *quaternion]))


def test_inverse_prefers_the_posture() -> None:
    kinematics = engine("panda")
    rest = kinematics.robot.rest
    pose = kinematics.forward(rest)
    np.testing.assert_allclose(kinematics.inverse(pose), rest, atol=2e-3)
    posture = rest + np.array([0.4, 0.0, -0.4, 0.0, 0.3, 0.0, 0.0])
    there = kinematics.inverse(pose, seed=posture, posture=posture)
    assert np.sum((there - posture) ** 2) < np.sum((rest - posture) ** 2)
    assert miss(kinematics.forward(there), pose) < (1e-4, 1e-4)
    np.testing.assert_array_equal(there, kinematics.inverse(pose, seed=posture, posture=posture))


@pytest.mark.parametrize("name", ["panda", "xarm7_ability", "so100"])
def test_jacobian_is_the_derivative(name: str) -> None:
    kinematics = engine(name)
    q, h = kinematics.robot.rest + 0.1, 1e-6
    J, base = kinematics.jacobian(q), kinematics.jacobian(q, "base")
    here = kinematics.forward(q)
    for i in range(len(q)):
        there = kinematics.forward(q + h * np.eye(len(q))[i])
        step = poses.multiply(poses.inverse(here), there)
        numeric = np.concatenate([step[:3], poses.rotation_vector(step[3:])]) / h
        np.testing.assert_allclose(J[:, i], numeric, atol=1e-5)
        np.testing.assert_allclose(base[:3, i], (there[:3] - here[:3]) / h, atol=1e-5)


def test_forward_and_jacobian_are_batched() -> None:
    kinematics = engine("panda")
    q = np.random.default_rng(0).uniform(-0.5, 0.5, (3, 2, 9)) + 0.1
    batch = kinematics.forward(q)
    assert batch.shape == (3, 2, 7)
    np.testing.assert_array_equal(batch[2, 1], kinematics.forward(q[2, 1, :7]))
    assert kinematics.jacobian(q).shape == (3, 2, 6, 7)


def test_link_poses_agree_with_the_tool() -> None:
    kinematics = engine("panda")
    robot = kinematics.robot
    joints = np.concatenate([robot.rest, robot.hand_open])
    links = kinematics.link_poses(joints)
    np.testing.assert_allclose(links[robot.base_link], [0, 0, 0, 1, 0, 0, 0], atol=1e-12)
    tool = poses.multiply(links[robot.tool_link], robot.tool_pose)
    np.testing.assert_allclose(tool, kinematics.forward(joints), atol=1e-12)
    assert set(kinematics.link_poses(joints, ["panda_hand"])) == {"panda_hand"}
    with pytest.raises(InputError, match="did you mean 'panda_hand'"):
        kinematics.link_poses(joints, ["panda_hnd"])


def table_poses(name: str, reach: float, tops: tuple[float, float]) -> list[Array]:
    """Poses for grasps from above about the table, the closing axis near the one that suits the arm."""
    robot = load_robot(name)
    rng = np.random.default_rng(1)
    out = [engine(name).forward(robot.rest)]
    while len(out) < 25:
        x, y, z = rng.uniform([0.35, -0.4, tops[0]], [0.65, 0.35, tops[1]])
        if np.hypot(x, y) < reach:
            turn = poses.yaw(np.arctan2(y, x) + rng.uniform(-0.6, 0.6))
            closing = poses.rotate(turn, robot.closing)
            out.append(np.array([x, y, z, *poses.frame_from_axes(np.array([0.0, 0.0, -1.0]), closing)]))
    return out


@pytest.mark.parametrize(("name", "margin"), [("panda", 0.2), ("xarm7_ability", 0.1)])
def test_moves_over_the_table_are_tracked(name: str, margin: float) -> None:
    kinematics = fresh(name)
    path = line(table_poses(name, 0.68, (0.01, 0.4)))
    check_tracked(kinematics, track(kinematics, path), path, margin=margin, step=0.15)


@pytest.mark.parametrize("y", [0.2, 0.3, 0.4])
def test_panda_moves_in_and_out_of_a_shelf_beside_it(y: float) -> None:
    kinematics = fresh("panda")
    rest = kinematics.forward(kinematics.robot.rest)
    spots = [(0.42, 0.52), (0.65, 0.52), (0.42, 0.52), (0.42, 0.2), (0.65, 0.2), (0.42, 0.2)]
    ahead = [np.array([x, y, z, *AHEAD]) for x, z in spots]
    turn = np.array([0.4, y / 2, 0.5, *TURN])
    path = line([rest, turn, *ahead, turn, rest])
    check_tracked(kinematics, track(kinematics, path), path, margin=0.1, step=0.08)


def test_panda_reaches_all_of_a_shelf_beside_it() -> None:
    kinematics = engine("panda")
    robot = kinematics.robot
    for x, y, z in itertools.product((0.38, 0.52, 0.66), (0.2, 0.3, 0.4), (0.1, 0.2, 0.35, 0.5, 0.6)):
        q = kinematics.inverse(np.array([x, y, z, *AHEAD]))
        assert np.minimum(q - robot.arm_lower, robot.arm_upper - q).min() > 0.05


def test_panda_reaches_obliquely_into_a_shelf_before_it() -> None:
    """39 degrees from above, as the bundled shelf's boards ask; in and out, and from one to the other."""
    kinematics = fresh("panda")
    approach = np.array([np.cos(np.deg2rad(39.0)), 0.0, -np.sin(np.deg2rad(39.0))])
    slanted = poses.frame_from_axes(approach, np.array([0.0, -1.0, 0.0]))
    rest = kinematics.forward(kinematics.robot.rest)
    for y in (-0.1, 0.0, 0.1):
        spots = [(0.46, 0.68), (0.66, 0.68), (0.46, 0.68), (0.46, 0.3), (0.66, 0.3), (0.46, 0.3)]
        path = line([rest, *(np.array([x, y, z, *slanted]) for x, z in spots), rest])
        joints = track(kinematics, path)
        assert miss(kinematics.forward(joints), np.array(path))[0] < 3e-3  # at a joint's speed limit
        check_limits(kinematics, joints, margin=0.1, step=0.131)


def test_tracking_keeps_limits_of_position_and_velocity_and_catches_up() -> None:
    kinematics = fresh("panda")
    robot = kinematics.robot
    goal = np.array([0.45, -0.4, 0.1, *DOWN])
    command, first = Command(tool=goal, hand=np.array([1.0])), state(kinematics)
    last = first.joint_position
    targets: list[JointTarget] = []
    for _ in range(60):
        target = kinematics.solve(command, first)
        step = target.position - last
        np.testing.assert_allclose(target.velocity, step / PERIOD, atol=1e-9)
        assert np.all(np.abs(target.velocity[:7]) <= robot.arm_velocity + 1e-9)
        assert np.all(np.abs(step[7:]) <= 0.04 * robot.hand_speed * PERIOD + 1e-9)
        last = target.position
        targets.append(target)
    assert np.abs(targets[0].velocity[:7] / robot.arm_velocity).max() == pytest.approx(1.0)
    assert miss(kinematics.forward(targets[-1].position), goal) < (1e-4, 1e-4)
    assert np.all(targets[-1].velocity == 0.0)
    np.testing.assert_allclose(targets[-1].position[7:], robot.hand_closed)


def test_nothing_commanded_holds_the_posture() -> None:
    kinematics = fresh("xarm7_ability")
    first = state(kinematics)
    target = kinematics.solve(Command(), first)
    np.testing.assert_array_equal(target.position, first.joint_position)
    assert np.all(target.velocity == 0.0)
    closing = kinematics.solve(Command(hand=np.array([0.5])), first)
    np.testing.assert_array_equal(closing.position[:7], first.joint_position[:7])
    assert np.any(closing.velocity[7:] != 0.0)


def test_tracking_does_not_drift_with_the_measured_joints() -> None:
    kinematics = fresh("panda")
    pose = kinematics.forward(kinematics.robot.rest)
    sagging = state(kinematics, kinematics.robot.rest + 0.02)
    kinematics.solve(Command(tool=pose), state(kinematics))
    for i in range(50):
        target = kinematics.solve(Command(tool=pose + 1e-6 * i * ALONG_X), sagging)
    assert np.abs(target.position[:7] - kinematics.robot.rest).max() < 1e-3


def test_same_commands_give_the_same_joints() -> None:
    path = line(table_poses("panda", 0.68, (0.01, 0.4))[:6])
    a, b = fresh("panda"), fresh("panda")
    np.testing.assert_array_equal(track(a, path), track(b, path))


def test_out_of_reach_while_tracking_leaves_the_target_alone() -> None:
    kinematics = fresh("panda")
    first = state(kinematics)
    pose = kinematics.forward(kinematics.robot.rest)
    before = kinematics.solve(Command(tool=pose), first)
    with pytest.raises(UnreachableError) as error:
        kinematics.solve(Command(tool=pose + ALONG_X), first)
    assert 0.3 < error.value.distance < 1.0
    after = kinematics.solve(Command(tool=pose), first)
    np.testing.assert_allclose(after.position, before.position, atol=1e-3)


def test_a_lock_at_a_limit_is_an_error_and_not_a_swing() -> None:
    """Turned about the approach on and on, the last joint ends at its limit."""
    kinematics = fresh("panda")
    pose = kinematics.forward(kinematics.robot.rest)
    joints = [kinematics.solve(Command(tool=pose), state(kinematics)).position]
    with pytest.raises(UnreachableError, match="without swinging into another posture"):
        for i in range(200):
            turned = np.concatenate([pose[:3], poses.quat_multiply(pose[3:], poses.yaw(0.05 * i))])
            joints.append(kinematics.solve(Command(tool=turned), state(kinematics)).position)
    assert np.abs(np.diff(joints, axis=0)).max() < 0.131  # the last joint's speed limit
