"""Motions along ways: from rest to rest, within the limits of joints and tool, and where the way is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.planning.reference_motion import minimum_jerk
from bt_tasksim.planning.route import SAMPLES, Pace, followed, hurries, timed

PACE = Pace(0.5)


def in_time(route, n=400):
    """Joints ``(n, n_arm)`` and tool positions ``(n, 3)`` at even times, as they are played."""
    place = minimum_jerk(np.linspace(0.0, 1.0, n)) * (len(route.joints) - 1)
    grid = np.arange(len(route.joints))
    joints = np.stack([np.interp(place, grid, q) for q in route.joints.T], axis=-1)
    tools = np.stack([np.interp(place, grid, p) for p in route.tools[:, :3].T], axis=-1)
    return joints, tools, route.duration / (n - 1)


def ways(bench, seed, corners):
    rng, robot = np.random.default_rng(seed), bench.robot
    around = robot.rest + rng.normal(scale=0.5, size=(corners + 2, len(robot.rest)))
    return list(np.clip(around, robot.arm_lower, robot.arm_upper))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), corners=st.integers(0, 4))
def test_limits_of_joints_and_tool_are_kept(each, seed, corners):
    route = timed(each.arm, ways(each, seed, corners), PACE, lambda q: True)
    joints, tools, step = in_time(route)
    speed = np.abs(np.diff(joints, axis=0)).max(axis=0) / step
    assert (speed <= each.robot.arm_velocity * 1.01).all()
    assert np.linalg.norm(np.diff(tools, axis=0), axis=-1).max() / step <= PACE.speed * 1.1
    smooth = 25  # the table's rows are joined by lines: their kinks are no accelerations
    slower = joints[::smooth]
    acceleration = np.abs(np.diff(slower, 2, axis=0)).max(axis=0) / (step * smooth) ** 2
    assert (acceleration <= each.robot.arm_acceleration).all()


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), corners=st.integers(0, 4))
def test_it_begins_and_ends_at_rest_where_the_way_does(panda, seed, corners):
    way = ways(panda, seed, corners)
    route = timed(panda.arm, way, PACE, lambda q: True)
    joints, _, step = in_time(route)
    speed = np.abs(np.diff(joints, axis=0)) / step
    assert speed[0].max() < 0.01 and speed[-1].max() < 0.01
    assert np.allclose(route.joints[0], way[0]) and np.allclose(route.joints[-1], way[-1])
    assert np.allclose(panda.arm.tools(route.joints), route.tools)
    assert route.joints.shape == (SAMPLES, len(panda.robot.rest))


def test_corners_are_cut_only_where_that_is_allowed(panda):
    rest = panda.robot.rest
    aside = np.eye(len(rest))[0] * 0.6
    up = np.eye(len(rest))[1] * 0.4
    way = [rest, rest + aside, rest + aside + up]

    def nearest(route):
        return np.abs(route.joints - way[1]).max(axis=-1).min()

    assert nearest(timed(panda.arm, way, PACE, None)) < 0.02
    assert nearest(timed(panda.arm, way, PACE, lambda q: True)) > 0.05
    assert nearest(timed(panda.arm, way, PACE, lambda q: False)) < 0.02


def test_slower_tools_take_longer(panda):
    way = [panda.posture(0.4, -0.2, 0.4), panda.posture(0.4, 0.2, 0.4)]
    slow, fast = (timed(panda.arm, way, Pace(v), None).duration for v in (0.1, 0.5))
    assert slow > 2 * fast


def test_an_elbow_that_turns_fast_while_the_tool_hardly_moves_is_hurried(panda):
    line = np.array([panda.posture(0.4, y, 0.4) for y in np.linspace(-0.1, 0.1, 11)])
    assert not hurries(panda.arm, line, PACE)
    assert hurries(panda.arm, line, Pace(20.0)), "joints have limits of their own"
    swung = line.copy()
    swung[6:] = panda.arm.joints(panda.arm.tool(line[6]), line[6] + 0.5 * np.eye(len(line[6]))[2])
    assert hurries(panda.arm, swung, PACE)


def test_a_way_without_length_takes_the_shortest_time(panda):
    route = timed(panda.arm, [panda.robot.rest] * 2, PACE, None)
    assert np.isfinite(route.joints).all() and route.duration == pytest.approx(0.3)


def test_postures_close_together_are_followed(panda):
    start = panda.posture(0.45, -0.1, 0.4)
    line = panda.arm.along(start, np.array([panda.pose(0.45, y, 0.4) for y in np.linspace(-0.09, 0.1, 20)]))
    route = followed(panda.arm, np.concatenate([start[None], line]), PACE)
    assert np.abs(route.tools[:, 0] - 0.45).max() < 2e-3 and np.abs(route.tools[:, 2] - 0.4).max() < 2e-3
