"""The inside of things, and what tells things of one name apart."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.planning.things import LEAST, SKIN, Thing, box_corners, inner, shrunk, told_apart
from bt_tasksim.scene.chords import faces

STILL = poses.pose([0.0, 0.0, 0.0])
PRISM = np.array([[x, y, z] for x, y in ((0.0, 0.0), (0.1, 0.0), (0.0, 0.1)) for z in (0.0, 0.1)])
"""Its slanted side goes through the middle of its box."""


def test_every_side_of_a_prism_lies_as_far_in():
    deepest = (faces(PRISM)[:, :3] @ shrunk(PRISM).T + faces(PRISM)[:, 3:]).max(axis=1)
    assert deepest == pytest.approx(-SKIN, abs=1e-6)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_every_side_of_any_piece_does(seed):
    piece = np.random.default_rng(seed).normal(scale=0.1, size=(30, 3))
    planes, inside = faces(piece), shrunk(piece)
    assert (planes[:, :3] @ inside.T + planes[:, 3:] <= -SKIN + 1e-6).all()


def test_of_a_board_that_is_thinner_than_two_skins_some_is_left():
    high = np.ptp(shrunk(box_corners((0.3, 0.3, 0.008))), axis=0)[2]
    assert high == pytest.approx(LEAST * 0.008, abs=1e-6)


def test_pieces_without_an_inside_are_left_out():
    flat = box_corners((0.1, 0.1, 0.0))
    assert shrunk(flat) is None
    assert shrunk(box_corners((0.1, 0.1, 1e-5))) is None
    (one,) = inner(Thing("mug", STILL, pieces=[flat, PRISM]))
    assert one.name == "the inside of mug, piece 1"


def test_things_of_one_name_are_told_apart_and_called_the_same():
    things = told_apart([Thing(name, STILL, (0.1, 0.1, 0.1)) for name in ("shelf", "mug", "shelf")])
    assert [thing.name for thing in things] == ["shelf", "mug", "shelf"]
    assert [thing.known_as for thing in things] == ["shelf, part 0", "mug", "shelf, part 2"]
    assert [thing.known_as for thing in told_apart(things)] == [thing.known_as for thing in things]
    insides = [piece.known_as for thing in things for piece in inner(thing)]
    assert len(set(insides)) == 3
