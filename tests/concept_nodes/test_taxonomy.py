"""The taxonomy's classes for known contacts, and the laws that any set of contacts obeys."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from benchmarks.taxonomy import BORDER, brute_force, measured, random_faces
from bt_tasksim.concept.contact import ContactChange
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept_nodes.contact_cones import MEASURED, cone_dimensions, padded
from bt_tasksim.concept_nodes.contact_tasks import PAPER, Change, task, tasks, tasks_between, time_reverses
from bt_tasksim.concept_nodes.taxonomy import (
    STATES,
    ContactState,
    contact_state,
    contact_states,
    dimensions,
    rotation_normals,
    rotation_state,
    rotation_states,
    translation_state,
)
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import parts, register, scratch

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


@given(st.lists(grid_normals, min_size=1, max_size=8))
def test_a_set_gets_the_same_in_any_batch(sets):
    normals, there = padded(sets)
    alone = [STATES.index(translation_state(each)) for each in sets]
    assert contact_states(normals, there, 1e-6).tolist() == alone
    assert contact_states(normals[::-1], there[::-1], 1e-6).tolist() == alone[::-1]


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_measured_contacts_get_the_class_that_brute_force_finds_for_exact_ones(seed):
    rng = np.random.default_rng(seed)
    exact = [random_faces(rng) for _ in range(3)]
    judged = [(each, found) for each in exact if (found := brute_force(each)).border >= BORDER]
    for each, found in judged:
        given_normals = measured(each, rng, MEASURED / 2)
        assert contact_states(*padded([given_normals]))[0] == STATES.index(contact_state(found.dimensions))
        assert dimensions(each) == found.dimensions


@given(st.integers(0, 2**32 - 1), rotations)
def test_measured_contacts_may_be_turned_shuffled_and_repeated(seed, rotation):
    rng = np.random.default_rng(seed)
    exact = random_faces(rng)
    if not len(exact) or brute_force(exact).border < BORDER:
        return
    normals = measured(exact, rng, MEASURED / 2)
    same = [
        normals,
        rotation.apply(normals),
        rng.permutation(normals),
        np.concatenate([normals, measured(exact, rng, MEASURED / 2)]),
    ]
    assert len({tuple(row) for row in cone_dimensions(*padded(same), MEASURED).tolist()}) == 1


@given(st.integers(0, 2**32 - 1))
def test_no_sampled_motion_contradicts_the_class(seed):
    """Dense sampling: it finds motions where there should be some, and none where there are none."""
    rng = np.random.default_rng(seed)
    exact = random_faces(rng)
    found = brute_force(exact)
    if not len(exact) or found.border < BORDER:
        return
    directions = rng.normal(size=(4000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    least = (directions @ exact.T).min(axis=1)
    c = dimensions(exact).c
    assert (least.max() > 0.0) == (c == 0)
    if c == 3:
        assert least.max() < -BORDER / 2


@given(grid_normals.filter(len), st.integers(0, 2**32 - 1), st.booleans())
def test_rotations_of_many_sets_are_those_of_each(normals, seed, about_axis):
    rng = np.random.default_rng(seed)
    points = rng.integers(-2, 3, normals.shape).astype(float)
    there = np.ones((1, len(normals)), dtype=bool)
    centre, axis = np.zeros((1, 3)), np.array([[0.0, 0.0, 2.0]])
    given_axis = axis if about_axis else None
    found = rotation_states(normals[None], there, points[None], centre, given_axis, 1e-6, 1e-9)[0]
    if not about_axis:
        assert STATES[found] is rotation_state(normals, points, centre[0])
        return
    # Bearings are contacts, too: two that keep each other axis from turning, from both sides.
    bearings = np.array([Z, -Z, Z, -Z]), np.array([X, X, Y, Y])
    every = np.concatenate([normals, bearings[0]]), np.concatenate([points, bearings[1]])
    assert STATES[found] is rotation_state(*every, centre[0])


@pytest.mark.parametrize("forward", PAPER, ids=lambda t: t.name)
def test_time_reversal_is_an_involution_and_swaps_breaking_and_making(forward):
    swapped = {Change.BREAKS: Change.MAKES, Change.MAKES: Change.BREAKS, Change.KEEPS: Change.KEEPS}
    (backward,) = (each for each in PAPER if each.what == (forward.motion, forward.after, forward.before))
    assert backward.change is swapped[forward.change] and backward.state is forward.state
    assert time_reverses(forward)
    for each in time_reverses(forward):
        assert each.change is swapped[forward.change]
        assert forward.what in {other.what for other in time_reverses(each)}


def test_tasks_are_those_of_the_registered_concepts_and_of_the_paper():
    assert (task("pick").change, task("pick").node) == (Change.BREAKS, "Pick")
    assert task("bring").change is Change.KEEPS
    assert task("place") in time_reverses(task("pick"))
    assert tasks_between(ContactState.FT, ContactState.NC) == ()
    declared = {
        (c.contact.motion, c.contact.before, c.contact.after)
        for c in parts("concept").values()
        if issubclass(c, ConceptModel) and c.contact is not None and c.contact.to == "environment"
    }
    assert {each.what for each in tasks() if each.node} == declared
    assert {each.what for each in PAPER} <= {each.what for each in tasks()}
    assert not {each.what for each in tasks() if not each.node} & declared
    for motion in ("translation", "rotation"):
        assert {each.state for each in tasks() if each.motion == motion} == set(ContactState)


def test_a_new_concept_announces_its_task():
    with scratch():

        @register("concept")
        class Wedge(ConceptModel):
            """Push something that slides until it is stuck."""

            contact = ContactChange(ContactState.TR, ContactState.FT)

        assert task("wedge").node == "Wedge" and task("wedge").change is Change.MAKES
        assert task("wedge") in tasks_between(ContactState.TR, ContactState.FT)
    assert not tasks_between(ContactState.TR, ContactState.FT)


def test_bad_input_is_refused_in_one_sentence():
    with pytest.raises(InputError, match="did you mean 'pick'"):
        task("pik")
    with pytest.raises(InputError, match="add up to 3"):
        contact_state((3, 1, 0))
    with pytest.raises(InputError, match="shape"):
        dimensions([[1.0, 0.0]])
    with pytest.raises(InputError, match="contact normal 1 is zero"):
        dimensions([[1.0, 0, 0], [0, 0, 0]])
    with pytest.raises(InputError, match="contact normal 1 of set 0 is zero"):
        contact_states(np.array([[X, 0 * X], [X, Y]]), np.ones((2, 2), dtype=bool))
    with pytest.raises(InputError, match="a centre for each set"):
        rotation_states(np.ones((1, 1, 3)), np.ones((1, 1), bool), np.ones((1, 2, 3)), np.zeros((1, 3)))
    with pytest.raises(InputError, match="tolerance of contact normals"):
        dimensions([X], tolerance=1.0)
    with pytest.raises(InputError, match="one point each"):
        rotation_normals([X, Y], [[0, 0, 0]], [0, 0, 0])


UP, ASIDE = [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]]


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        (lambda: rotation_state(UP, [[np.nan, 0.0, 0.0]], [0.0, 0.0, 0.0]), "contact points: .* not finite"),
        (lambda: rotation_state(UP, ASIDE, [np.nan, 0.0, 0.0]), "the centre: .* not finite"),
        (lambda: rotation_state(UP, ASIDE, [0.0]), "the centre: shape"),
        (lambda: rotation_state(UP, [[1.0, 0.0]], [0.0, 0.0, 0.0]), "contact points: shape"),
        (lambda: rotation_state(UP, [[1.0, 0.0], [1.0]], [0.0, 0.0, 0.0]), "contact points: no numbers"),
        (lambda: rotation_state(UP, ASIDE, [0.0, 0.0, 0.0], lever=np.nan), "lever"),
        (lambda: translation_state([["up", "down", "left"]]), "no numbers"),
        (lambda: contact_state((1.5, 0.5, 1)), "must add up to 3"),
        (lambda: translation_state(np.random.default_rng(0).normal(size=(300, 3))), "300 contact normals"),
        (lambda: translation_state(np.random.default_rng(0).normal(size=(3000, 3))), "3000 contact normals"),
        (
            lambda: rotation_states(
                np.array([UP]), np.ones((1, 1), bool), np.array([ASIDE]), np.full((1, 3), np.nan)
            ),
            "finite",
        ),
    ],
)
def test_what_is_no_set_of_contacts_is_said(call, reason):
    with pytest.raises(InputError, match=reason):
        call()


def test_many_normals_of_one_direction_are_one_contact():
    near = [0.0, 0.0, 1.0] + 1e-4 * np.random.default_rng(0).normal(size=(600, 3))
    assert translation_state(near, tolerance=0.01) == ContactState.PC
