"""What nodes in many worlds share; that they tick like py_trees' is shown by the executor's tests."""

from __future__ import annotations

import numpy as np
import pytest

from bt_tasksim.trees.nodes.base import NodeKind
from bt_tasksim.trees.nodes.batch import Arrays
from bt_tasksim.trees.vocabulary import node_kinds


@pytest.mark.parametrize("library", ["numpy", "torch"])
def test_rows_are_grouped_by_their_keys(library):
    xp = pytest.importorskip(library)
    arrays = Arrays(10, xp)
    keys, rows = xp.asarray([2, 0, 2, 5, 0]), xp.asarray([9, 8, 7, 6, 5])
    found = {key: sorted(there.tolist()) for key, there in arrays.groups(keys, rows)}
    assert found == {0: [5, 8], 2: [7, 9], 5: [6]}
    assert [(key, there.tolist()) for key, there in arrays.groups(keys[1:2], rows[1:2])] == [(0, [8])]
    assert not list(arrays.groups(keys[:0], rows[:0]))


def test_every_kind_of_node_of_the_package_has_a_form_for_batches():
    assert all(type(kind).compiled is not NodeKind.compiled for kind in node_kinds().values())


def test_arrays_are_of_the_library_and_the_type():
    full = Arrays(3).full(0.5, "float64", 2)
    assert full.shape == (2, 3) and full.dtype == np.float64
