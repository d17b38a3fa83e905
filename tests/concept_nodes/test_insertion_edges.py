"""Where something is held up on an edge of a hole, by what the wrist feels, and how it gets away."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.concept_nodes.insertion_edges import STEP, TURN, Edges, away, held_up_at
from bt_tasksim.core import poses

TURNS = st.tuples(*[st.floats(-1.5, 1.5)] * 3).map(lambda v: poses.from_rotation_vector(np.array(v)))
SIDE = st.floats(-1.0, 1.0)
FORCES = st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(3.0, 30.0))
HALF, ROOM, LOW = np.array([0.06, 0.016]), np.array([0.01, 0.003]), 0.08


def edges(hole):
    """A hole that points along the z axis of a rotation ``(4,)``, for a book."""
    axes = poses.rotate(np.tile(hole, (2, 1)), np.eye(3)[:2])
    return Edges(axes[None], HALF[None], ROOM[None], np.array([LOW]))


@settings(max_examples=60, deadline=None)
@given(hole=TURNS, x=SIDE, y=SIDE, force=FORCES, grip=st.tuples(*[st.floats(-0.05, 0.05)] * 3))
def test_a_force_at_a_place_is_felt_there(hole, x, y, force, grip):
    """Whichever way the hole points, where the hand holds, and what presses from aside."""
    inward = -poses.z_axis(hole)
    middle = np.array([0.5, 0.1, 0.3])
    at = np.array([x, y]) * HALF
    tool = middle + poses.rotate(hole, np.array(grip))
    point = middle + poses.rotate(hole, np.array([*at, -LOW]))
    pressed = poses.rotate(hole, np.array(force))
    load = np.concatenate([pressed, np.cross(point - tool, pressed)])
    identity = np.array([1.0, 0.0, 0.0, 0.0])
    felt = held_up_at(
        poses.pose(tool, identity)[None],
        poses.pose(middle, identity)[None],
        load[None],
        inward[None],
        edges(hole),
    )
    assert felt[0, 0] == pytest.approx(force[2], abs=1e-9)
    place = poses.rotate(poses.quat_conjugate(hole), felt[0, 1:] / felt[0, 0])
    assert place == pytest.approx([*at, 0.0], abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(hole=TURNS, x=SIDE, y=SIDE)
def test_it_goes_away_from_the_side_that_is_tight_and_turns_from_a_corner(hole, x, y):
    inward = -poses.z_axis(hole)
    place = poses.rotate(hole, np.array([x * HALF[0], y * HALF[1], 0.0]))
    aside, turn = away(np.concatenate([[10.0], 10.0 * place])[None], inward[None], edges(hole))
    local = poses.rotate(poses.quat_conjugate(hole), aside[0])
    assert local[0] == pytest.approx(0.0, abs=1e-12)  # it has much more room that way
    assert local[1] == pytest.approx(-STEP * np.sign(y) if abs(y) > 0.35 else 0.0, abs=1e-12)
    if abs(x) > 0.35 and abs(y) > 0.35:
        moved = float(turn[0]) * np.cross(inward, place)
        assert abs(turn[0]) == TURN
        assert poses.rotate(poses.quat_conjugate(hole), moved)[1] * y < 0.0
    else:
        assert turn[0] == 0.0


def test_what_is_hardly_felt_moves_nothing():
    hole = np.array([1.0, 0.0, 0.0, 0.0])
    aside, turn = away(np.array([[1.0, 0.06, 0.016, 0.0]]), np.array([[0.0, 0.0, -1.0]]), edges(hole))
    assert not aside.any() and not turn.any()
