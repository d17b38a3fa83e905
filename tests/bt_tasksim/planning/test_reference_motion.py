"""Reference motions: where they begin and end, how fast they are, and that they are smooth."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.planning.reference_motion import (
    TURN_BACK,
    Path,
    minimum_jerk,
    minimum_jerk_time,
    plan,
    sample,
)
from tests.array_libraries import agree


def random_poses(seed, n):
    rng = np.random.default_rng(seed)
    p = rng.uniform(-0.4, 0.4, (n, 7))
    p[:, 3:] = poses.normalise(rng.normal(size=(n, 4)))
    return [pose[None] for pose in p]


def one(position):
    return poses.pose(position)[None]


def at(path, times):
    """Poses ``(n, 7)`` of a single path at several times."""
    many = Path(*(np.repeat(part, len(times), axis=0) for part in path))
    return sample(many, np.asarray(times, float))


def walk(path, n=600):
    times = np.linspace(0.0, float(path.duration[0]), n)
    return times, at(path, times)


def test_minimum_jerk_begins_and_ends_at_rest():
    f = np.linspace(0, 1, 1001)
    s = minimum_jerk(f)
    assert s[0] == 0 and s[-1] == pytest.approx(1) and np.all(np.diff(s) >= 0)
    speed = np.gradient(s, f)
    assert speed[0] < 0.01 and speed[-1] < 0.01 and speed.max() == pytest.approx(1.875, abs=1e-3)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 5), st.floats(0.1, 1.0))
def test_a_path_joins_its_ends_within_its_speeds(seed, n, speed):
    points = random_poses(seed, n)
    path = plan(points, speed, turn=1.5)
    times, tool = walk(path)
    assert np.allclose(tool[0], points[0], atol=1e-9)
    assert np.allclose(tool[-1][:3], points[-1][0, :3], atol=1e-9)
    assert poses.angle_between(tool[-1][3:], points[-1][0, 3:]) < 1e-6
    dt = times[1]
    assert np.linalg.norm(np.diff(tool[:, :3], axis=0), axis=-1).max() / dt < 1.05 * speed
    turning = [float(poses.angle_between(a[3:], b[3:])) / dt for a, b in pairwise(tool)]
    assert max(turning) < 1.05 * 1.5
    assert np.allclose(np.linalg.norm(tool[:, 3:], axis=-1), 1.0)


def test_a_corner_is_rounded_and_no_more_than_asked():
    a, b, c = (one(p) for p in ([0, 0, 0], [0.4, 0, 0], [0.4, 0.4, 0]))
    _, tool = walk(plan([a, b, c], 0.5, blend=0.05, samples=400))
    near = np.linalg.norm(tool[:, :3] - b[0, :3], axis=-1).min()
    assert 0.005 < near < 0.05
    off = np.minimum(np.abs(tool[:, 1]), np.abs(tool[:, 0] - 0.4))
    assert off.max() < 0.05 and np.all(off[np.linalg.norm(tool[:, :3] - b[0, :3], axis=-1) > 0.051] < 1e-3)


def accelerations(path, period=0.01):
    tool = at(path, np.arange(-0.1, float(path.duration[0]) + 0.1, period))[:, :3]
    velocity = np.diff(tool, axis=0) / period
    smooth = np.array([np.convolve(v, np.full(5, 0.2), "valid") for v in velocity.T]).T  # the table's steps
    return np.linalg.norm(np.diff(smooth, axis=0), axis=-1) / period


@pytest.mark.parametrize("aside", [0.0, 0.01, 0.02])
@pytest.mark.parametrize("up", [0.03, 0.06, 0.1])
def test_a_path_that_turns_back_does_so_gently(up, aside):
    low, high, end = (one(p) for p in ([0, 0, 0.05], [aside, 0, 0.05 + up], [aside, 0, 0.0]))
    path = plan([low, high, end], 0.5, blend=0.03, samples=200)
    assert accelerations(path).max() < 1.3 * TURN_BACK
    _, tool = walk(path)
    assert tool[:, 2].max() > 0.05 + up / 4 and np.allclose(tool[-1], end[0])
    assert np.abs(tool[:, 0] - aside / 2).max() <= aside / 2 + 1e-9  # and beside no line


@settings(max_examples=25, deadline=None)
@given(st.floats(0.02, 0.5), st.floats(0.5, 5.0))
def test_a_short_path_is_not_hurried(length, acceleration):
    a, b = one([0.3, 0.1, 0.2]), one([0.3, 0.1, 0.2 + length])
    path = plan([a, b], 0.5, acceleration=acceleration, samples=2)
    times, tool = walk(path, 2001)
    z = tool[:, 2]
    assert np.abs(np.diff(z, 2)).max() / times[1] ** 2 <= 1.01 * acceleration
    assert path.duration[0] >= plan([a, b], 0.5, samples=2).duration[0]


def test_a_straight_path_is_straight():
    first, last = one([0.3, 0.1, 0.2]), one([0.5, -0.2, 0.4])
    _, tool = walk(plan([first, last], 0.3))
    a, b = first[0], last[0]
    d = (b - a)[:3] / np.linalg.norm((b - a)[:3])
    gap = tool[:, :3] - a[:3]
    assert np.abs(gap - np.outer(gap @ d, d)).max() < 1e-9


def test_paths_without_length():
    p = random_poses(3, 1)[0]
    for path in (plan([p], 0.5), plan([p, p], 0.5), plan([p, p, p], 0.5)):
        assert path.duration == pytest.approx([0.3])
        assert np.allclose(at(path, [-1.0, 0.1, 99.0]), p)


def test_it_waits_before_the_begin_and_after_the_end():
    path = plan(random_poses(4, 3), 0.5)
    before, begin, after = at(path, [-1.0, 0.0, path.duration[0] + 5.0])
    assert np.array_equal(before, begin)
    assert np.allclose(after, path.table[0, -1], atol=1e-12)


# ---- many worlds ------------------------------------------------------------------------------------------

WORLDS = 65


def unlike(seed, corners=4, worlds=WORLDS):
    """Waypoints of unlike worlds: some of them straight, some that turn back, some that end early."""
    rng = np.random.default_rng(seed)
    points = [rng.uniform(-0.4, 0.4, (worlds, 7)) for _ in range(corners)]
    for pose in points:
        pose[:, 3:] = poses.normalise(rng.normal(size=(worlds, 4)))
    for k in range(worlds):
        kind = k % 4
        if kind == 1:  # there and back
            points[2][k] = poses.interpolate(points[1][k], points[0][k], 0.9)
        elif kind == 2:  # the last one is repeated, as where others have more of them
            for pose in points[2:]:
                pose[k] = points[1][k]
        elif kind == 3:  # stands still
            for pose in points[1:]:
                pose[k] = points[0][k]
    return points


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("settings_", [{}, {"samples": 2}, {"acceleration": 3.0, "blend": 0.03}])
def test_unlike_worlds_have_the_paths_that_they_have_alone(rows_alike, seed, settings_):
    points = unlike(seed)
    rows_alike(lambda rows: plan([pose[rows] for pose in points], 0.5, **settings_), WORLDS)


@pytest.mark.parametrize("seed", range(3))
def test_unlike_worlds_are_sampled_as_each_one_alone(rows_alike, seed):
    path = plan(unlike(seed), 0.4)
    times = np.random.default_rng(seed).uniform(-0.2, 1.2, WORLDS) * path.duration
    rows_alike(lambda rows: sample(Path(path.table[rows], path.duration[rows]), times[rows]), WORLDS)


@pytest.mark.parametrize("scale", [1.0, 1.0 + 3e-8])
@pytest.mark.parametrize("corners", [1, 2, 3, 5])
def test_a_waypoint_that_is_repeated_at_the_end_changes_no_bit(corners, scale):
    """Where others have more waypoints; also of quaternions of single precision."""
    points = [pose * np.repeat([1.0, scale], [3, 4]) for pose in random_poses(7, corners)]
    path, padded = plan(points, 0.5), plan([*points, *[points[-1]] * 3], 0.5)
    assert np.array_equal(padded.duration, path.duration)
    assert np.array_equal(padded.table, path.table)


@pytest.mark.parametrize("corners", range(1, 6))
@pytest.mark.parametrize("settings_", [{}, {"samples": 2, "acceleration": 3.0}])
def test_every_library_and_device_plans_and_samples_the_same(corners, settings_):
    points = unlike(corners, 4)[:corners] if corners < 5 else unlike(corners, 5)
    path = agree(lambda points: plan(points, 0.4, **settings_), points, single_close=None)
    times = np.random.default_rng(corners).uniform(-0.2, 1.2, WORLDS) * path.duration
    agree(sample, path, times, close=1e-12, single_close=1e-5)
    half = plan([pose.astype(np.float32) for pose in points], 0.4, **settings_)
    assert np.abs(half.duration - path.duration).max() < 1e-3
    assert np.abs(half.table[:, [0, -1], :3] - path.table[:, [0, -1], :3]).max() < 1e-6


@pytest.mark.parametrize("shape", [(65,), (5, 13)])
def test_every_library_and_device_has_the_same_minimum_jerk(shape):
    places = np.linspace(0.0, 1.0, 65).reshape(shape)
    agree(minimum_jerk, places, close=1e-12)
    agree(minimum_jerk_time, places[..., 1:-1], close=1e-12, single_close=1e-3)


def test_a_minimum_jerks_time_is_the_way_back_from_its_place(rows_alike):
    fractions = np.linspace(0.0, 1.0, 500)
    places = minimum_jerk(fractions)
    found = rows_alike(lambda rows: minimum_jerk_time(places[rows]), len(places))
    assert np.abs(minimum_jerk(found) - places).max() < 1e-3
    assert found[0] == 0.0 and found[-1] == pytest.approx(1.0)
