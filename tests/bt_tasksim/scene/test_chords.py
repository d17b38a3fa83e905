"""How thick bodies are along lines: known ones exactly; the same for a body in two pieces."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.planning.things import box_corners
from bt_tasksim.scene.chords import chords

X, Y = np.eye(3)[:2]
SIZE = (0.06, 0.04, 0.1)


def one(pieces, point, direction):
    return float(chords(pieces, np.array([point]), np.array([direction]))[0])


@given(st.floats(-0.019, 0.019), st.floats(-0.049, 0.049), st.floats(-1.0, 1.0))
def test_a_box_is_as_thick_as_its_side_wherever_a_line_along_it_goes(across, up, along):
    assert one([box_corners(SIZE)], [along, across, up], X) == pytest.approx(SIZE[0])


def test_a_line_beside_a_body_meets_nothing():
    assert one([box_corners(SIZE)], [0.0, 0.021, 0.0], X) == 0.0
    assert one([box_corners(SIZE)], [0.0, 0.0, 0.051], Y) == 0.0


def test_a_cylinder_is_thinner_beside_its_middle():
    angles = np.linspace(0.0, 2 * np.pi, 256, endpoint=False)
    ring = np.c_[0.03 * np.cos(angles), 0.03 * np.sin(angles)]
    body = np.concatenate([np.c_[ring, np.full(256, z)] for z in (-0.05, 0.05)])
    for beside in (0.0, 0.01, 0.02):
        assert one([body], [beside, 0.0, 0.01], Y) == pytest.approx(
            2 * np.sqrt(0.03**2 - beside**2), abs=1e-4
        )


def test_a_body_in_pieces_counts_from_where_the_first_begins_to_where_the_last_ends():
    half = box_corners((0.03, 0.04, 0.1))
    apart = [half - 0.025 * X, half + 0.025 * X]
    assert one(apart, [0.0, 0.0, 0.0], X) == pytest.approx(0.08)
    assert one(apart, [0.025, 0.0, 0.0], Y) == pytest.approx(0.04)
