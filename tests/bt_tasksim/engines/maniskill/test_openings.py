"""Holes between boxes: where they are, how wide and how deep, and what has none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.engines.maniskill.openings import opening
from bt_tasksim.scene.box import Box

UNTURNED = (1.0, 0.0, 0.0, 0.0)


def walls(hole, centre, depth=0.2, outer=0.3):
    """Four boxes about a hole along x, of full size ``hole (2,)`` and with its middle at ``centre (2,)``."""
    (w, h), (y, z) = hole, centre
    left, right = y - w / 2 + outer / 2, outer / 2 - y - w / 2
    low, high = z - h / 2 + outer / 2, outer / 2 - z - h / 2
    return [
        Box((0.0, (-outer / 2 + y - w / 2) / 2, 0.0, *UNTURNED), (depth, left, outer)),
        Box((0.0, (outer / 2 + y + w / 2) / 2, 0.0, *UNTURNED), (depth, right, outer)),
        Box((0.0, 0.0, (-outer / 2 + z - h / 2) / 2, *UNTURNED), (depth, outer, low)),
        Box((0.0, 0.0, (outer / 2 + z + h / 2) / 2, *UNTURNED), (depth, outer, high)),
    ]


@given(
    st.tuples(st.floats(0.02, 0.1), st.floats(0.02, 0.1)),
    st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)),
    st.sampled_from([-1.0, 1.0]),
)
def test_the_hole_is_found(hole, centre, sense):
    found = opening(walls(hole, centre), np.array([sense, 0.0, 0.0]), "block")
    assert found.extent == pytest.approx(hole, abs=1e-9) and found.depth == pytest.approx(0.2)
    assert found.pose[:3] == pytest.approx([sense * 0.1, *centre], abs=1e-9), "its far end"
    assert poses.z_axis(found.pose[3:]) == pytest.approx([-sense, 0.0, 0.0], abs=1e-9), "out of it"


def test_what_is_open_to_a_side_is_no_hole():
    with pytest.raises(InputError, match="block has no hole along"):
        opening(walls((0.04, 0.04), (0.0, 0.0))[1:], np.array([1.0, 0.0, 0.0]), "block")
