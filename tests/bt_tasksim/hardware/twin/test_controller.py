"""A trajectory controller: what it accepts comes to rest within limits; what it refuses changes nothing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.hardware.twin.controller import FASTER, Controller, RefusedTrajectoryError, Trajectory

LOWER, UPPER, SPEED = np.array([-1.0, -2.0]), np.array([1.0, 2.0]), np.array([1.0, 2.0])


def controller() -> Controller:
    return Controller(["a", "b"], LOWER, UPPER, SPEED, np.zeros(2))


def trajectory(**changes: Any) -> Trajectory:
    usual: dict[str, Any] = {
        "joints": ["a", "b"],
        "positions": [[0.05, 0.1], [0.08, 0.16]],
        "velocities": [[0.5, 1.0], [0.0, 0.0]],
        "times": [0.1, 0.25],
    }
    return Trajectory(**{**usual, **changes})


def test_it_passes_its_points_and_stands() -> None:
    c = controller()
    c.accept(trajectory(), 1.0)
    position, velocity = c.setpoint(1.1)
    assert np.allclose(position, [0.05, 0.1]) and np.allclose(velocity, [0.5, 1.0])
    assert c.ends() == 1.25
    for t in (1.25, 2.0, 100.0):
        position, velocity = c.setpoint(t)
        assert np.allclose(position, [0.08, 0.16]) and not velocity.any()


def test_joints_may_come_in_another_order_and_velocities_may_be_left_out() -> None:
    c = controller()
    c.accept(Trajectory(["b", "a"], [[0.2, 0.1]], [[]], [0.2]), 0.0)
    position, velocity = c.setpoint(0.1)
    assert np.allclose(position, [0.05, 0.1]) and np.allclose(velocity, [0.5, 1.0])


def test_the_next_one_begins_where_the_setpoint_is() -> None:
    c = controller()
    c.accept(trajectory(), 0.0)
    before = c.setpoint(0.07)
    c.accept(trajectory(positions=[[0.1, 0.2], [0.12, 0.24]]), 0.07)
    after = c.setpoint(0.07)
    assert np.array_equal(before[0], after[0]) and np.array_equal(before[1], after[1])


def test_it_stops_within_its_acceleration() -> None:
    c = controller()
    c.accept(trajectory(), 0.0)
    c.stop(0.1, np.array([5.0, 5.0]))
    assert c.ends() == pytest.approx(0.1 + 1.0 / 5.0)
    assert np.allclose(c.setpoint(1.0)[0], [0.05 + 0.05, 0.1 + 0.1])


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"joints": ["a", "c"]}, "not those of this controller"),
        ({"joints": ["a"]}, "not those"),
        ({"joints": []}, "not those"),
        ({"positions": [], "velocities": [], "times": []}, "0 points"),
        ({"times": [0.1]}, "2 points, 2 velocities and 1 times"),
        ({"positions": [[0.0, 0.0]] * 501}, "501 points"),
        ({"positions": [[0.05], [0.08]]}, "has not 2 numbers"),
        ({"positions": [[math.nan, 0.1], [0.08, 0.16]]}, "not every number is finite"),
        ({"positions": [[math.inf, 0.1], [0.08, 0.16]]}, "not every number is finite"),
        ({"positions": [[0.05, 0.1], [1.2, 0.16]]}, "a would leave its range"),
        ({"velocities": [[0.5, 1.0], [0.0, 0.5]]}, "does not end at rest"),
        ({"velocities": [[0.5, 1e9], [0.0, 0.0]]}, "beyond what the joint can do"),
        ({"velocities": [[0.5, 1.0], []]}, "has not 2 numbers"),
        ({"times": [0.1, 0.1]}, "times should rise"),
        ({"times": [0.0, 0.1]}, "times should rise"),
        ({"times": [-1.0, 0.1]}, "times should rise"),
        ({"times": [0.1, 1e6]}, "times should rise"),
        ({"times": [0.1, math.nan]}, "times should rise"),
        ({"times": [0.001, 0.25]}, "faster than it can"),
    ],
)
def test_what_is_refused_changes_nothing(changes: dict[str, Any], sentence: str) -> None:
    c = controller()
    c.accept(trajectory(), 0.0)
    before = [c.setpoint(t) for t in (0.05, 0.2, 0.5)]
    with pytest.raises(RefusedTrajectoryError, match=sentence):
        c.accept(trajectory(**changes), 0.05)
    after = [c.setpoint(t) for t in (0.05, 0.2, 0.5)]
    for (p, v), (q, w) in zip(before, after, strict=True):
        assert np.array_equal(p, q) and np.array_equal(v, w)


number = st.floats(allow_nan=True, allow_infinity=True, width=32)
row = st.lists(number, max_size=3)


@given(st.lists(row, max_size=4), st.lists(row, max_size=4), st.lists(number, max_size=4))
@settings(max_examples=300, deadline=None)
def test_nothing_but_a_refusal_or_a_motion_that_ends(
    positions: list[list[float]], velocities: list[list[float]], times: list[float]
) -> None:
    c = controller()
    try:
        c.accept(Trajectory(["a", "b"], positions, velocities, times), 0.0)
    except RefusedTrajectoryError:
        assert not c.setpoint(0.1)[0].any()
        return
    end, velocity = c.setpoint(c.ends())
    assert not velocity.any() and np.all(end >= LOWER - 0.01) and np.all(end <= UPPER + 0.01)


@given(st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_what_is_accepted_is_no_faster_than_it_may_be(seed: int) -> None:
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.05, 0.4, 4))
    positions = np.cumsum(rng.uniform(-0.2, 0.2, (4, 2)), axis=0)
    c = controller()
    try:
        c.accept(Trajectory(["a", "b"], positions.tolist(), [[]] * 4, times.tolist()), 0.0)
    except RefusedTrajectoryError:
        return
    for t in np.linspace(0.0, times[-1] + 0.1, 200):
        assert np.all(np.abs(c.setpoint(t)[1]) <= FASTER * SPEED + 0.01)
