"""Lines between postures: as fine as asked, and every point on them is asked about once."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.planning.lines import halves, line


@given(n=st.integers(0, 200))
def test_every_point_is_asked_once(n):
    assert sorted(halves(np.arange(n)[:, None])[:, 0].tolist()) == list(range(n))


@given(st.floats(0.001, 3.0), st.floats(0.01, 0.5))
def test_a_line_has_its_ends_and_no_larger_steps(length, step):
    found = line(np.zeros(2), np.array([length, -length / 2]), step)
    assert np.array_equal(found[0], np.zeros(2)) and np.allclose(found[-1], [length, -length / 2])
    assert np.abs(np.diff(found, axis=0)).max() <= step + 1e-9
