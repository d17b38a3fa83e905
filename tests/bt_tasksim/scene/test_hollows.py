"""Where things are hollow: meshes in convex parts, and cups."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.any_tree.meshes import FORMS, write
from bt_tasksim.core import poses
from bt_tasksim.scene.geometry import BoxPiece
from bt_tasksim.scene.hollows import hollow, outer_corners
from bt_tasksim.scene.shapes import KINDS, ShapeSize, shape
from tests.bt_tasksim.scene.solids import solids

HOLLOW = {"mug", "bowl", "jar", "ladle"}


@pytest.fixture(scope="module")
def forms(tmp_path_factory):
    files = write(tmp_path_factory.mktemp("meshes"), 5)
    return {name: str(file) for name, file in files.items()}


@pytest.mark.parametrize("name", FORMS)
def test_what_has_a_floor_and_walls_is_hollow(forms, name):
    size = KINDS["mesh"].sizes(forms[name])[0]
    boxes = shape("mesh", ShapeSize(size, mesh=forms[name])).hollow
    assert (len(boxes) > 0) is (name in HOLLOW)


def test_the_hollow_of_a_mug_is_round_and_ends_at_its_rim(forms):
    x, y, z = KINDS["mesh"].sizes(forms["mug"])[0]
    boxes = shape("mesh", ShapeSize((x, y, z), mesh=forms["mug"])).hollow
    away = np.hypot(boxes[:, 0] + (x - y) / 2, boxes[:, 1])
    assert away.max() < y / 2 and np.median(boxes[:, 5]) == pytest.approx(z / 2)
    assert np.median(boxes[:, 4]) == pytest.approx(-z / 2 + 0.006, abs=0.003)
    room = np.sum(4 * boxes[:, 2] * boxes[:, 3] * (boxes[:, 5] - boxes[:, 4]))
    assert room > 0.6 * np.pi * (y / 2 - 0.005) ** 2 * z


@given(st.floats(0.03, 0.12), st.floats(0.04, 0.12), st.integers(0, 10**6))
def test_points_in_a_cup(across, height, seed):
    """Well inside of the walls a point is in it, and well outside it is not."""
    size = (across, across, height)
    boxes, rng = shape("cup", ShapeSize(size)).hollow, np.random.default_rng(seed)
    points = rng.uniform(-0.6, 0.6, (200, 3)) * size
    near = np.abs(points[:, None, :2] - boxes[:, :2]) <= boxes[:, 2:4]
    level = (points[:, None, 2] >= boxes[:, 4]) & (points[:, None, 2] <= boxes[:, 5])
    found = (near.all(axis=-1) & level).any(axis=1)
    radius, floor = across / 2 - 0.004, -height / 2 + min(0.005, height / 4)
    away, cell = np.hypot(points[:, 0], points[:, 1]), across / 20
    well = (away < radius - cell) & (points[:, 2] > floor + 1e-6) & (points[:, 2] < height / 2)
    off = (away > radius + cell) | (points[:, 2] < floor - 1e-6) | (points[:, 2] > height / 2)
    assert found[well].all() and not found[off].any()


def test_a_cup_says_at_once_what_its_pieces_say():
    made = shape("cup", ShapeSize((0.07, 0.07, 0.1)))
    found = hollow(made.pieces, made.extent)
    assert np.allclose(np.unique(found[:, 4:], axis=0), [[-0.045, 0.05]], atol=1e-6)
    assert {tuple(c) for c in made.hollow[:, :2].round(6)} == {tuple(c) for c in found[:, :2].round(6)}


VESSELS = ("mesh", "cup", "bowl", "jug")
"""Kinds of which some are hollow."""


@given(solids(kinds=[kind for kind in sorted(KINDS) if kind not in VESSELS]))
def test_other_kinds_are_solid(solid):
    assert shape(*solid).hollow.shape == (0, 6)


def trough(ends):
    """A box open at the top of 10 x 6 x 4 cm, with walls along it, and some of its ends."""
    walls = [((0, 0, -0.018), (0.1, 0.06, 0.004)), ((0, 0.028, 0.002), (0.1, 0.004, 0.036)),
             ((0, -0.028, 0.002), (0.1, 0.004, 0.036))]  # fmt: skip
    walls += [((x, 0, 0.002), (0.004, 0.052, 0.036)) for x in (0.048, -0.048)[:ends]]
    return [BoxPiece(poses.pose(at), np.array(size) / 2).corners() for at, size in walls]


@pytest.mark.parametrize(("ends", "is_hollow"), [(2, True), (1, False), (0, False)])
def test_a_trough_without_its_ends_holds_nothing(ends, is_hollow):
    """But for what is near the end that it has, nearly all directions around which meet a wall."""
    boxes = hollow(trough(ends), (0.1, 0.06, 0.04))
    middle = np.all(np.abs(boxes[:, :2]) < 0.01, axis=1)
    assert bool(middle.any()) is is_hollow
    assert np.allclose(boxes[:, 4], -0.016) and np.allclose(boxes[:, 5], 0.02)


@given(solids())
def test_the_outer_corners_reach_as_far_as_the_pieces(solid):
    made = shape(*solid)
    ways = np.random.default_rng(0).normal(size=(50, 3))
    every = np.concatenate(made.pieces)
    assert np.allclose((made.outer @ ways.T).max(axis=0), (every @ ways.T).max(axis=0), atol=1e-9)


def test_of_many_corners_those_that_reach_farthest_are_kept():
    ball = np.random.default_rng(0).normal(size=(3000, 3))
    ball = 0.05 * ball / np.linalg.norm(ball, axis=1, keepdims=True)
    found, ways = outer_corners([ball]), ball / 0.05
    assert len(found) < 200
    assert np.max((ball @ ways.T).max(axis=0) - (found @ ways.T).max(axis=0)) < 0.002
