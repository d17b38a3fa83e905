"""Fronts of pieces: what level cuts say is what their hulls say."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.planning.profiles import fronts, section, solids
from bt_tasksim.planning.things import box_corners

LENGTHS = st.floats(0.02, 0.2)
PLACES = np.linspace(-0.15, 0.15, 31)


@given(st.tuples(LENGTHS, LENGTHS, LENGTHS), st.floats(-3.0, 3.0), st.floats(-0.09, 0.09))
def test_the_front_of_an_upright_box_is_where_its_faces_are(size, turn, height):
    pose = poses.pose(np.array([0.3, 0.0, 0.0]), poses.yaw(turn))
    (front,) = fronts(solids([box_corners(size)], pose), np.array([height]), PLACES)
    if abs(height) >= size[2] / 2:
        assert not np.isfinite(front).any()
        return
    for place, along in zip(PLACES, front, strict=True):
        ray = np.stack([np.linspace(0.0, 0.6, 2401), np.full(2401, place), np.full(2401, height)], axis=-1)
        within = (np.abs(poses.localise(pose, ray)) <= np.array(size) / 2 - 1e-9).all(axis=-1)
        if within.any():
            assert abs(ray[within, 0].max() - along) < 5e-4
        else:  # the ray passes by, or meets less of a corner than lies between two points
            assert not np.isfinite(along) or within.sum() == 0


@settings(max_examples=40)
@given(st.integers(0, 2**31), st.integers(5, 40), st.floats(-0.5, 0.5))
def test_no_corner_reaches_farther_than_the_fronts_of_all_cuts(seed, count, height):
    corners = np.random.default_rng(seed).normal(0.0, 0.05, (count, 3))
    (piece,) = solids([corners])
    cut = section(piece, height * 0.1)
    if len(cut):
        assert cut[:, 0].max() <= corners[:, 0].max() + 1e-12
        assert cut[:, 0].min() >= corners[:, 0].min() - 1e-12
    heights = np.sort(corners[:, 2])[1:-1]
    inner = corners[np.isin(corners[:, 2], heights)]
    places = np.sort((inner[:, 1, None] + [-1e-9, 0.0, 1e-9]).ravel())  # a grid would pass a needle by
    reached = fronts([piece], heights, places)
    assert reached.max() >= inner[:, 0].max() - 1e-6


def test_two_pieces_reach_as_far_as_the_farther_one():
    near, far = box_corners((0.1, 0.1, 0.1)), box_corners((0.02, 0.02, 0.1)) + np.array([0.2, 0.0, 0.0])
    (front,) = fronts(solids([near, far]), np.zeros(1), np.array([0.0, 0.03, 0.08]))
    assert np.allclose(front[:2], [0.21, 0.05]) and front[2] == -np.inf
