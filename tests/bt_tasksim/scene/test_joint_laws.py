"""When parts count as open, shut or set, wherever their limits begin; tasks end where they do."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.concept_nodes import AdjustDoor, CloseDoor, OpenDoor, TurnKnob
from bt_tasksim.scene.joint_laws import SHUT_HINGE, SHUT_SLIDE, opened, set_to, shut

lows = st.floats(-1.0, 1.0)
widths = st.floats(0.2, 2.5)
shares = st.floats(0.0, 1.0)
TURNS = np.array([True])


@given(lows, widths, shares, shares)
def test_tasks_end_where_the_laws_say_that_it_is_so(low, width, begin, end):
    limits = np.array([[low, low + width]])
    now, asked = limits[:, 0] + begin * width, float(low + end * width)
    assert shut(CloseDoor.value("door").wanted(now, limits), limits, TURNS).so.all()
    assert opened(OpenDoor.value("door").wanted(now, limits), limits, None, 0.0).so.all()
    assert opened(OpenDoor.value("door", angle=asked).wanted(now, limits), limits, asked, 1e-9).so.all()
    for task in (AdjustDoor.value("door", angle=asked), TurnKnob.value("door", angle=asked)):
        assert set_to(task.wanted(now, limits), asked, 1e-9).so.all()


@pytest.mark.parametrize(("turns", "allowed"), [(True, SHUT_HINGE), (False, SHUT_SLIDE)])
def test_shut_is_the_lower_limit_and_not_0(turns, allowed):
    limits, kinds = np.array([[-0.4, 1.0]] * 3), np.array([turns] * 3)
    found = shut(np.array([-0.4, -0.4 + 1.1 * allowed, 0.0]), limits, kinds)
    assert found.so.tolist() == [True, False, False] and found.off[2] == pytest.approx(0.4)


def test_open_counts_from_0_and_without_a_value_from_the_lower_limit():
    limits, value = np.array([[-0.5, 1.5]]), np.array([1.0])
    assert opened(value, limits, 1.0, 0.0).so.all() and not opened(value, limits, 1.2, 0.1).so.any()
    assert opened(value, limits, None, 0.0).wanted == pytest.approx(1.1)
