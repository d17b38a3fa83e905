"""Rows that come last, in every library and on every device."""

from __future__ import annotations

import numpy as np
import pytest

from bt_tasksim.core.poses import host
from bt_tasksim.robot.kinematics import rows as of
from tests.array_libraries import LIBRARIES, agree

VALUES = np.random.default_rng(0).normal(size=(3, 2, 5))
MASK = np.array([[True, False, False], [True, True, False]])
INDEX = np.array([4, 0, 1])


def test_rows_are_taken_and_put_and_joined() -> None:
    np.testing.assert_array_equal(agree(lambda v: of.taken(v, INDEX), VALUES), VALUES[..., INDEX])
    changed = VALUES.copy()
    changed[..., INDEX] = -1.0
    new = np.full((3, 2, 3), -1.0)
    np.testing.assert_array_equal(agree(lambda v, w: of.put(v, INDEX, w), VALUES, new), changed)
    where = [INDEX, np.array([2, 3])]
    pieces = [[VALUES[..., rows], VALUES[0][..., rows]] for rows in where]
    for whole, wanted in zip(agree(lambda p: of.joined(p, where), pieces), (VALUES, VALUES[0]), strict=True):
        np.testing.assert_array_equal(whole, wanted)
    assert agree(lambda p: of.joined(p, where[:1]), pieces[:1])[0].shape == (3, 2, 3)
    np.testing.assert_array_equal(agree(of.columns, VALUES[0]), VALUES[0].T)
    np.testing.assert_array_equal(agree(lambda v: of.chosen(v, np.array([2, 0])), VALUES), VALUES[[2, 0]])


def test_bounds_and_masks() -> None:
    np.testing.assert_array_equal(agree(of.highest, VALUES[0]), VALUES[0].max(axis=0))
    np.testing.assert_array_equal(agree(lambda v: of.at_least(v, 0.3), VALUES), np.maximum(VALUES, 0.3))
    assert agree(of.either, MASK).tolist() == [True, True, False]


@pytest.mark.parametrize("library", LIBRARIES)
def test_masks_are_read_from_wherever_they_are(library: str) -> None:
    mask = LIBRARIES[library](MASK)
    assert of.some(mask) and not of.every(mask) and not of.some(mask & ~mask) and of.every(mask | ~mask)
    first = mask[0, :]
    assert of.where_true(first).tolist() == [0] and type(host(first)) is np.ndarray
