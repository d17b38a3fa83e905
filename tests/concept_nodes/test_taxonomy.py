"""The taxonomy's classes for known contacts, and the laws that any set of contacts obeys."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from bt_tasksim.concept_nodes.taxonomy import (
    TASKS,
    Change,
    ContactState,
    contact_state,
    dimensions,
    rotation_normals,
    rotation_state,
    task,
    tasks_between,
    time_reverse,
    translation_state,
)
from bt_tasksim.core.errors import InputError

X, Y, Z = np.eye(3)

ALL_TEN = {
    (3, 0, 0): ([], ContactState.NC),
    (2, 1, 0): ([Z], ContactState.PC),
    (1, 2, 0): ([Z, X], ContactState.PC),
    (0, 3, 0): ([Z, X, Y], ContactState.PC),
    (2, 0, 1): ([Z, -Z], ContactState.TR),
    (1, 1, 1): ([Z, -Z, X], ContactState.OT),
    (0, 2, 1): ([Z, -Z, X, Y], ContactState.OT),
    (1, 0, 2): ([Z, -Z, X, -X], ContactState.PR),
    (0, 1, 2): ([Z, -Z, X, -X, Y], ContactState.OP),
    (0, 0, 3): ([Z, -Z, X, -X, Y, -Y], ContactState.FT),
}

grid_normals = st.lists(st.tuples(*[st.integers(-1, 1)] * 3).filter(any), min_size=0, max_size=7).map(
    lambda rows: np.array(rows, dtype=float).reshape(-1, 3)
)
rotations = st.integers(0, 2**32 - 1).map(lambda seed: Rotation.random(rng=np.random.default_rng(seed)))


@pytest.mark.parametrize(("triple", "case"), ALL_TEN.items())
def test_all_ten_triples_occur_and_give_seven_classes(triple, case):
    normals, expected = case
    assert dimensions(normals) == triple
    assert contact_state(triple) is translation_state(normals) is expected


def test_a_closed_triangle_of_normals_leaves_no_motion_in_its_plane():
    around = [[np.cos(a), np.sin(a), 0.0] for a in np.deg2rad([90, 210, 330])]
    assert dimensions(around) == (1, 0, 2)


def test_a_hinge_is_prismatic_in_rotation_and_its_stop_blocks_one_sense():
    points = np.array([[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]], dtype=float)
    bearings = np.array([Z, -Z, Z, -Z])  # two-sided along z, away from the axis: turns about z only
    assert rotation_state(bearings, points, [0, 0, 0]) is ContactState.PR
    stop = (np.vstack([bearings, Y]), np.vstack([points, X]))
    assert rotation_state(*stop, [0, 0, 0]) is ContactState.OP


def test_a_contact_whose_normal_meets_the_centre_does_not_restrict_rotation():
    assert rotation_normals([Z], [[0, 0, -0.3]], [0, 0, 0]).shape == (0, 3)


@given(grid_normals)
def test_dimensions_add_up_to_three(normals):
    assert sum(dimensions(normals)) == 3
    assert min(dimensions(normals)) >= 0


@given(grid_normals, rotations)
def test_turning_everything_changes_nothing(normals, rotation):
    turned = rotation.apply(normals) if len(normals) else normals
    assert dimensions(turned) == dimensions(normals)


@given(grid_normals, st.randoms(use_true_random=False), st.floats(0.1, 10))
def test_order_length_and_repetition_of_normals_do_not_matter(normals, random, scale):
    again = [scale * row for row in normals] + list(normals)
    random.shuffle(again)
    assert dimensions(again) == dimensions(normals)


@given(grid_normals, st.tuples(*[st.integers(-1, 1)] * 3).filter(any))
def test_one_more_contact_never_gives_freedom(normals, extra):
    before, after = dimensions(normals), dimensions(np.vstack([normals, extra]))
    assert after.m <= before.m
    assert after.c >= before.c


@given(grid_normals.filter(len), rotations, st.integers(0, 2**32 - 1))
def test_rotation_about_a_point_moves_with_the_world(normals, rotation, seed):
    points = np.random.default_rng(seed).integers(-2, 3, normals.shape).astype(float)
    shift = np.array([0.3, -0.2, 0.9])
    moved = rotation_state(rotation.apply(normals), rotation.apply(points) + shift, shift)
    assert moved is rotation_state(normals, points, [0, 0, 0])


@pytest.mark.parametrize("forward", TASKS, ids=lambda t: t.name)
def test_time_reversal_is_an_involution_and_swaps_breaking_and_making(forward):
    backward = time_reverse(forward)
    assert time_reverse(backward) is forward
    swapped = {Change.BREAKS: Change.MAKES, Change.MAKES: Change.BREAKS, Change.KEEPS: Change.KEEPS}
    assert backward.change is swapped[forward.change]


def test_the_five_concepts_of_the_first_issue():
    assert task("pick").change is Change.BREAKS
    assert task("bring").change is Change.KEEPS
    assert time_reverse(task("pick")) is task("place")
    assert [t.name for t in tasks_between(ContactState.OP, ContactState.PR, "rotation")] == ["open_door"]
    assert tasks_between(ContactState.FT, ContactState.NC) == ()


def test_bad_input_is_refused_in_one_sentence():
    with pytest.raises(InputError, match="did you mean 'pick'"):
        task("pik")
    with pytest.raises(InputError, match="add up to 3"):
        contact_state((3, 1, 0))
    with pytest.raises(InputError, match="shape"):
        dimensions([[1.0, 0.0]])
    with pytest.raises(InputError, match="contact normal 1 is zero"):
        dimensions([[1.0, 0, 0], [0, 0, 0]])
    with pytest.raises(InputError, match="one point each"):
        rotation_normals([X, Y], [[0, 0, 0]], [0, 0, 0])
