"""Laws of braking and following: limits are never exceeded, and what keeps them is left alone."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.hardware.safety.motion import (
    JointMotion,
    approach,
    braked,
    followed,
    moved,
    stopping_speed,
)

PERIOD = 0.05
N = 3
VELOCITY = np.array([2.0, 3.0, 1.0])
ACCELERATION = np.array([15.0, 7.5, 20.0])
LOWER, UPPER = np.array([-1.0, -2.0, -0.5]), np.array([1.0, 0.5, 0.5])

speeds = st.floats(0.0, 10.0)
accelerations = st.floats(0.5, 50.0)
rows = st.lists(st.lists(st.floats(-4.0, 4.0), min_size=N, max_size=N), min_size=1, max_size=30)


def braking_distance(velocity, acceleration, period):
    """How far joints get ``(n,)`` after the last period, slowing down by a T in each until they stand.

    Speeds v - a T, v - 2 a T, ... are summed up while they are positive.
    """
    speed, change = np.abs(velocity), acceleration * period
    n = np.where(np.isfinite(change), np.floor(speed / change), 0.0)
    return period * (n * speed - np.where(n > 0.0, change, 0.0) * n * (n + 1.0) / 2.0)


def still(position):
    return JointMotion(np.array(position, float), np.zeros(len(position)))


def follow(before, reference):
    return followed(before, reference, VELOCITY, ACCELERATION, LOWER, UPPER, PERIOD)


@given(speeds, accelerations)
def test_braking_distance_is_what_braking_takes(speed, acceleration):
    motion = JointMotion(np.zeros(1), np.array([speed]))
    a = np.array([acceleration])
    far = braking_distance(motion.velocity, a, PERIOD)
    while motion.velocity.any():
        motion = braked(motion, a, PERIOD)
    np.testing.assert_allclose(motion.position, far, atol=1e-9)


@given(speeds, accelerations)
def test_stopping_speed_is_the_inverse(speed, acceleration):
    v, a = np.array([speed]), np.array([acceleration])
    room = PERIOD * v + braking_distance(v, a, PERIOD)
    np.testing.assert_allclose(stopping_speed(room, a, PERIOD), v, atol=1e-9)


def test_joints_without_a_limit():
    endless = np.array([np.inf])
    assert braking_distance(np.array([3.0]), endless, PERIOD) == 0.0
    assert stopping_speed(np.array([0.1]), endless, PERIOD) == 0.1 / PERIOD
    assert stopping_speed(endless, np.array([5.0]), PERIOD) == np.inf
    assert stopping_speed(np.array([-0.1]), np.array([5.0]), PERIOD) == 0.0
    assert braked(JointMotion(np.zeros(1), np.array([3.0])), endless, PERIOD).velocity == 0.0


@given(rows)
def test_whatever_the_reference_no_limit_is_exceeded(positions):
    motion = reference = still([0.0, 0.0, 0.0])
    for position in positions:
        reference = moved(reference, np.array(position), PERIOD)
        after = follow(motion, reference)
        np.testing.assert_allclose(after.position, motion.position + PERIOD * after.velocity, atol=1e-9)
        assert np.all(np.abs(after.velocity) <= VELOCITY + 1e-9)
        assert np.all(np.abs(after.velocity - motion.velocity) <= ACCELERATION * PERIOD + 1e-9)
        assert np.all((after.position >= LOWER - 1e-9) & (after.position <= UPPER + 1e-9))
        motion = after
    for _ in range(100):
        motion = braked(motion, ACCELERATION, PERIOD)
        assert np.all((motion.position >= LOWER - 1e-9) & (motion.position <= UPPER + 1e-9))
    assert not motion.velocity.any()


@given(st.lists(st.lists(st.floats(-1.0, 1.0), min_size=N, max_size=N), min_size=1, max_size=40))
def test_a_reference_within_the_limits_is_followed_to_the_bit(pushes):
    motion = reference = still([0.0, -0.5, 0.0])
    for push in pushes:  # a reference that can always still stop before its limits
        room = np.minimum(stopping_speed(UPPER - reference.position, ACCELERATION, PERIOD), VELOCITY)
        back = np.minimum(stopping_speed(reference.position - LOWER, ACCELERATION, PERIOD), VELOCITY)
        v = reference.velocity + 0.99 * np.array(push) * ACCELERATION * PERIOD
        v = np.minimum(np.maximum(v, -0.99 * back), 0.99 * room)
        if np.any(np.abs(v - reference.velocity) > ACCELERATION * PERIOD):
            v = braked(reference, ACCELERATION, PERIOD).velocity
        reference = moved(reference, reference.position + PERIOD * v, PERIOD)
        motion = follow(motion, reference)
        assert np.array_equal(motion.position, reference.position)


def test_a_joint_that_lags_catches_up_and_stays():
    motion, goal = still([0.0, 0.0, 0.0]), still([0.8, -1.0, 0.3])
    for k in range(60):
        motion = follow(motion, goal)
        assert np.all(np.abs(motion.position) <= np.abs(goal.position) + 1e-9), f"overshoots at {k}"
    assert np.array_equal(motion.position, goal.position) and not motion.velocity.any()


@given(st.lists(st.floats(-2.0, 2.0), min_size=N, max_size=N))
def test_an_approach_ends_at_its_goal_at_rest(goal):
    way = list(approach(np.zeros(N), np.array(goal), VELOCITY, ACCELERATION, PERIOD))
    before = still(np.zeros(N))
    for motion in way:
        assert np.all(np.abs(motion.velocity) <= VELOCITY + 1e-9)
        assert np.all(np.abs(motion.velocity - before.velocity) <= ACCELERATION * PERIOD + 1e-9)
        before = motion
    assert np.array_equal(before.position, np.array(goal)) and not before.velocity.any()
