"""Outlines from above: hulls, distances and depths, against laws that hold for all polygons."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from bt_tasksim.core import poses
from bt_tasksim.scene.outlines import distance, holds, hull, rectangle

SQUARE = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])


def cloud(seed, n=12):
    return np.random.default_rng(seed).uniform(-1, 1, (n, 2))


@given(st.integers(0, 10**6), st.integers(4, 40))
def test_hull_is_that_of_scipy(seed, n):
    points = cloud(seed, n)
    ours = hull(points)
    theirs = points[ConvexHull(points).vertices]
    first = np.argmin(np.linalg.norm(theirs - ours[0], axis=1))
    assert np.allclose(ours, np.roll(theirs, -first, axis=0), atol=1e-9)
    assert holds(ours, points, -1e-9)


@given(st.integers(0, 10**6), st.floats(-3, 3), st.floats(-3, 3), st.floats(-np.pi, np.pi))
def test_distance_is_symmetric_and_moves_with_both(seed, x, y, angle):
    a, b = hull(cloud(seed)), hull(cloud(seed + 1) + np.array([x, y]))
    found = distance(a, b)
    assert found == pytest.approx(distance(b, a), abs=1e-12)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    assert distance(a @ turn.T + 1.0, b @ turn.T + 1.0) == pytest.approx(found, abs=1e-9)


@given(st.integers(0, 10**6), st.floats(2.0, 5.0), st.floats(-np.pi, np.pi))
def test_distance_is_that_of_the_nearest_points(seed, far, angle):
    a, b = hull(cloud(seed)), hull(cloud(seed + 1)) + far * np.array([np.cos(angle), np.sin(angle)])

    def along(p):
        share = np.linspace(0, 1, 60)[:, None, None]
        return (p * (1 - share) + np.roll(p, -1, axis=0) * share).reshape(-1, 2)

    sampled = np.linalg.norm(along(a)[:, None] - along(b), axis=2).min()
    found = distance(a, b)
    assert found <= 0.0 or sampled - 0.05 <= found <= sampled + 1e-9


@pytest.mark.parametrize(
    ("shift", "expected"), [((3.0, 0.0), 1.0), ((1.5, 0.0), -0.5), ((5.0, 6.0), 5.0), ((0.0, 0.0), -2.0)]
)
def test_squares(shift, expected):
    assert distance(SQUARE, SQUARE + shift) == pytest.approx(expected)


def test_a_rectangle_turns_with_its_place():
    corner = rectangle(poses.pose([1.0, 0.0, 0.3], poses.yaw(np.pi / 2)), (0.1, 0.0), (0.4, 0.2))
    assert np.allclose(corner.min(axis=0), [0.9, -0.1]) and np.allclose(corner.max(axis=0), [1.1, 0.3])
    assert holds(corner, np.array([[1.0, 0.0]]), 0.09) and not holds(corner, np.array([[1.0, 0.0]]), 0.11)
