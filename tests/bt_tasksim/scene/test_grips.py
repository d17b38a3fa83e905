"""Grips of the built-in kinds, and grips as people give them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial import ConvexHull

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.scene.grips import GivenGrip, Grips
from bt_tasksim.scene.kinds.cup import WALL
from bt_tasksim.scene.mesh_surface import MeshSurface
from bt_tasksim.scene.shapes import KnownSolid, ShapeSize, object_model, shape, shape_kind
from tests.bt_tasksim.scene.solids import MADE, solids

EXPONENTS = (0.2, 1.2)


@settings(max_examples=40, deadline=None)
@given(solids(exponents=EXPONENTS))
def test_contacts_lie_on_the_surface_a_width_apart(case):
    kind, size = case
    grips = shape_kind(kind).grips(size)
    assert 1 <= len(grips) <= 64
    np.testing.assert_allclose(np.linalg.norm(grips.closing, axis=1), 1.0)
    assert np.all((grips.firmness > 0) & (grips.firmness <= 1)) and np.all(np.diff(grips.firmness) <= 0)
    surface = MeshSurface(shape(kind, size).visual)
    for sign in (-1, 1):
        contacts = grips.points + sign * grips.widths[:, None] / 2 * grips.closing
        np.testing.assert_allclose(surface.nearest(contacts), contacts, atol=1e-3)


@settings(max_examples=60, deadline=None)
@given(solids(tuple(k for k in MADE if k != "cup"), EXPONENTS))
def test_the_solid_faces_the_fingers_within_the_friction_cone(case):
    grips = shape_kind(case[0]).grips(case[1])
    hull = ConvexHull(shape(*case).visual.vertices)
    normals, offsets = hull.equations[:, :3], hull.equations[:, 3]
    for sign in (-1, 1):
        contacts = grips.points + sign * grips.widths[:, None] / 2 * grips.closing
        depth = contacts @ normals.T + offsets
        facing = np.where(
            depth > np.max(depth, axis=1, keepdims=True) - 1e-3, sign * grips.closing @ normals.T, -1
        )
        assert np.all(np.max(facing, axis=1) > math.cos(math.atan(0.4)) - 0.03)


def test_all_faces_of_a_cube():
    grips = shape_kind("cube").grips(ShapeSize((0.05, 0.05, 0.05)))
    assert {tuple(np.abs(c)) for c in grips.closing} == {(1, 0, 0), (0, 1, 0), (0, 0, 1)}
    assert grips.firmness == pytest.approx(1.0) and grips.widths == pytest.approx(0.05)


def test_tall_things_are_held_at_three_heights_and_long_ones_beside_the_middle():
    grips = shape_kind("box").grips(ShapeSize((0.1, 0.04, 0.1)))
    narrow = np.abs(grips.closing[:, 1]) > 0.9
    places = {(round(x, 3), round(z, 3)) for x, _, z in grips.points[narrow]}
    assert places == {(x, z) for x in (-0.025, 0.0, 0.025) for z in (-0.03, 0.0, 0.03)}
    assert np.allclose(grips.points[0], 0) and grips.firmness[0] == 1.0
    assert np.all(np.isnan(grips.approach))


def test_a_cylinder_is_held_from_eight_directions():
    grips = shape_kind("cylinder").grips(ShapeSize((0.05, 0.05, 0.1)))
    level = np.abs(grips.closing[:, 2]) < 0.5
    angle = np.round(np.degrees(np.arctan2(grips.closing[level, 1], grips.closing[level, 0])) % 180, 3)
    assert sorted(set(angle.tolist())) == [22.5 * k for k in range(8)]
    assert np.all(grips.firmness[level] < 1.0)


def test_the_rim_of_a_cup_is_held_from_above_and_less_firmly():
    grips = shape_kind("cup").grips(ShapeSize((0.07, 0.07, 0.1)))
    rim = np.abs(grips.widths - WALL) < 1e-9
    assert np.sum(rim) == 8
    np.testing.assert_array_equal(grips.approach[rim], np.tile([0.0, 0.0, -1.0], (8, 1)))
    assert np.max(grips.firmness[rim]) < np.min(grips.firmness[~rim])


def test_an_ellipsoid_is_held_less_firmly_than_a_box_like_one():
    size = (0.08, 0.05, 0.07)
    soft, hard = (shape_kind("superellipsoid").grips(ShapeSize(size, (e, e))) for e in (1.0, 0.2))
    assert hard.firmness[0] > 0.99 > soft.firmness[0] > 0.5
    assert hard.widths[0] == pytest.approx(soft.widths[0]) == 0.05
    assert len(hard) > len(soft)


def test_what_is_too_wide_is_held_at_its_narrowest():
    grips = shape_kind("box").grips(ShapeSize((0.3, 0.2, 0.25)))
    assert np.all(grips.widths == 0.2)


def test_given_grips_replace_those_of_the_kind():
    given = (
        GivenGrip((0.0, 0.0, 0.02), (0.0, 2.0, 0.0), 0.03, (0.0, 0.0, -1.0), 0.5),
        GivenGrip((0.01, 0.0, 0.0), (1.0, 0.0, 0.0), 0.02),
    )
    model = object_model("it", "box", ShapeSize((0.06, 0.04, 0.08)), given, symmetry=4)
    assert model.solid == KnownSolid("box", ShapeSize((0.06, 0.04, 0.08)), given)
    grips = model.solid.grips
    np.testing.assert_allclose(grips.widths, [0.02, 0.03])
    np.testing.assert_allclose(grips.closing, [[1, 0, 0], [0, 1, 0]])
    assert np.all(np.isnan(grips.approach[0])) and grips.approach[1].tolist() == [0, 0, -1]
    assert model.grasp_axes == ((1, 0, 0), (0, 1, 0)) and model.grasp_widths == (0.02, 0.03)
    assert model.symmetry == 4


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"point": (math.nan, 0, 0)}, "finite"),
        ({"closing": (0, 0, 0)}, "not zero"),
        ({"approach": (0, 0, 0)}, "not zero"),
        ({"width": 0.0}, "width should be positive"),
        ({"width": 1e9}, "metres"),
        ({"firmness": 1.5}, "between 0 and 1"),
    ],
)
def test_given_grips_that_cannot_be_are_refused(changed, words):
    usual = {"point": (0, 0, 0), "closing": (0, 1, 0), "width": 0.03}
    assert len(Grips.given([GivenGrip(**usual)])) == 1
    with pytest.raises(InputError, match=words):
        GivenGrip(**{**usual, **changed})


def test_the_axes_of_an_l_are_those_of_its_arms():
    path = str(asset("objects", "bracket.obj"))
    model = object_model("l", "mesh", ShapeSize((0.09, 0.028, 0.075), mesh=path))
    assert model.grasp_widths[0] == pytest.approx(0.028, abs=1e-4) or model.grasp_widths[0] == pytest.approx(
        0.022, abs=1e-4
    )
    for axis in model.grasp_axes:
        assert np.linalg.norm(axis) == pytest.approx(1.0)
