"""Where an arm that lags is expected: against fine steps of the drive's law, and what counts as beside it."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.hardware.safety.lagging import beyond, followed_lagging

ANGLE = st.floats(-2.0, 2.0)


@settings(deadline=None)
@given(ANGLE, ANGLE, ANGLE, st.floats(0.01, 0.5), st.floats(0.02, 0.3))
def test_it_is_the_response_of_a_drive_that_lags(before, start, end, seconds, lag):
    at, steps = before, 20_000
    for k in range(steps):
        target = start + (end - start) * (k + 0.5) / steps
        at += (target - at) / lag * seconds / steps
    found = followed_lagging(*(np.array([v]) for v in (before, start, end)), seconds, lag)
    assert np.isclose(found[0], at, atol=1e-3)


@given(ANGLE, ANGLE, st.floats(0.0, 0.5))
def test_an_arm_without_lag_is_where_it_is_told_to_be(before, end, seconds):
    assert followed_lagging(np.array([before]), np.array([0.0]), np.array([end]), seconds, 0.0)[0] == end


@given(ANGLE, ANGLE, st.floats(0.0, 1.0), ANGLE)
def test_what_is_between_is_not_off_and_nothing_is_farther_off_than_its_target(
    expected, target, share, measured
):
    one, other = np.array([expected]), np.array([target])
    assert beyond(one + share * (other - one), one, other)[0] < 1e-12
    assert beyond(np.array([measured]), one, other)[0] <= abs(measured - target) + 1e-12
