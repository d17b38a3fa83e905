"""Reference motions: where they begin and end, how fast they are, and that they are smooth."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.planning.reference_motion import TURN_BACK, Path, minimum_jerk, plan, sample

torch = pytest.importorskip("torch")


def random_poses(seed, n):
    rng = np.random.default_rng(seed)
    p = rng.uniform(-0.4, 0.4, (n, 7))
    p[:, 3:] = poses.normalise(rng.normal(size=(n, 4)))
    return list(p)


def walk(path, n=600):
    times = np.linspace(0.0, float(path.duration), n)
    return times, np.array([sample(path, t) for t in times])


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
    assert np.allclose(tool[-1][:3], points[-1][:3], atol=1e-9)
    assert poses.angle_between(tool[-1][3:], points[-1][3:]) < 1e-6
    dt = times[1]
    assert np.linalg.norm(np.diff(tool[:, :3], axis=0), axis=-1).max() / dt < 1.05 * speed
    turning = [float(poses.angle_between(a[3:], b[3:])) / dt for a, b in pairwise(tool)]
    assert max(turning) < 1.05 * 1.5
    assert np.allclose(np.linalg.norm(tool[:, 3:], axis=-1), 1.0)


def test_a_corner_is_rounded_and_no_more_than_asked():
    a, b, c = (poses.pose(p) for p in ([0, 0, 0], [0.4, 0, 0], [0.4, 0.4, 0]))
    _, tool = walk(plan([a, b, c], 0.5, blend=0.05, samples=400))
    near = np.linalg.norm(tool[:, :3] - b[:3], axis=-1).min()
    assert 0.005 < near < 0.05
    off = np.minimum(np.abs(tool[:, 1]), np.abs(tool[:, 0] - 0.4))
    assert off.max() < 0.05 and np.all(off[np.linalg.norm(tool[:, :3] - b[:3], axis=-1) > 0.051] < 1e-3)


def accelerations(path, period=0.01):
    tool = np.array([sample(path, t)[:3] for t in np.arange(-0.1, float(path.duration) + 0.1, period)])
    velocity = np.diff(tool, axis=0) / period
    smooth = np.array([np.convolve(v, np.full(5, 0.2), "valid") for v in velocity.T]).T  # the table's steps
    return np.linalg.norm(np.diff(smooth, axis=0), axis=-1) / period


@pytest.mark.parametrize("aside", [0.0, 0.01, 0.02])
@pytest.mark.parametrize("up", [0.03, 0.06, 0.1])
def test_a_path_that_turns_back_does_so_gently(up, aside):
    low, high, end = (poses.pose(p) for p in ([0, 0, 0.05], [aside, 0, 0.05 + up], [aside, 0, 0.0]))
    path = plan([low, high, end], 0.5, blend=0.03, samples=200)
    assert accelerations(path).max() < 1.3 * TURN_BACK
    _, tool = walk(path)
    assert tool[:, 2].max() > 0.05 + up / 4 and np.allclose(tool[-1], end)
    assert np.abs(tool[:, 0] - aside / 2).max() <= aside / 2 + 1e-9  # and beside no line


@settings(max_examples=25, deadline=None)
@given(st.floats(0.02, 0.5), st.floats(0.5, 5.0))
def test_a_short_path_is_not_hurried(length, acceleration):
    a, b = poses.pose([0.3, 0.1, 0.2]), poses.pose([0.3, 0.1, 0.2 + length])
    path = plan([a, b], 0.5, acceleration=acceleration, samples=2)
    times = np.linspace(0.0, float(path.duration), 2001)
    z = np.array([sample(path, t)[2] for t in times])
    assert np.abs(np.diff(z, 2)).max() / times[1] ** 2 <= 1.01 * acceleration
    assert float(path.duration) >= float(plan([a, b], 0.5, samples=2).duration)


def test_a_straight_path_is_straight():
    a, b = poses.pose([0.3, 0.1, 0.2]), poses.pose([0.5, -0.2, 0.4])
    _, tool = walk(plan([a, b], 0.3))
    d = (b - a)[:3] / np.linalg.norm((b - a)[:3])
    gap = tool[:, :3] - a[:3]
    assert np.abs(gap - np.outer(gap @ d, d)).max() < 1e-9


def test_paths_without_length():
    p = random_poses(3, 1)[0]
    for path in (plan([p], 0.5), plan([p, p], 0.5), plan([p, p, p], 0.5)):
        assert path.duration == pytest.approx(0.3)
        assert np.allclose(sample(path, 0.1), p) and np.allclose(sample(path, 99.0), p)


def test_it_waits_before_the_begin_and_after_the_end():
    path = plan(random_poses(4, 3), 0.5)
    assert np.array_equal(sample(path, -1.0), sample(path, 0.0))
    assert np.allclose(sample(path, float(path.duration) + 5.0), path.table[-1], atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_one_batch_and_torch_sample_the_same(seed):
    paths = [plan(random_poses(seed + k, 3), 0.2 + 0.1 * k) for k in range(4)]
    rng = np.random.default_rng(seed)
    times = rng.uniform(-0.2, 1.2, 4) * np.array([p.duration for p in paths])
    batch = Path(np.stack([p.table for p in paths]), np.array([p.duration for p in paths]))
    one = np.array([sample(p, t) for p, t in zip(paths, times, strict=True)])
    assert np.allclose(sample(batch, times), one, rtol=0, atol=1e-12)
    in_torch = sample(Path(*(torch.from_numpy(x) for x in batch)), torch.from_numpy(times))
    assert np.allclose(in_torch.numpy(), one, rtol=0, atol=1e-12)
