"""The search for a way: allowed all along, the same for the same request, and none where there is none."""

import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.planning.lines import STEP, line
from bt_tasksim.planning.search import QUESTIONS, Search, _without_repeats

LOW, HIGH = np.full(2, -2.0), np.full(2, 2.0)


def around(gap):
    """A wall at x = 0 in a plane, open where y is above ``gap``."""
    return lambda q: abs(q[0]) > 0.1 or q[1] > gap


def search(free, seed=1):
    return Search(free, LOW, HIGH, np.zeros(2), seed)


@settings(max_examples=25, deadline=None)
@given(gap=st.floats(-1.0, 1.5), seed=st.integers(1, 1000), y=st.floats(-1.5, 1.0))
def test_a_way_is_allowed_at_finer_steps_than_it_was_asked_at(gap, seed, y):
    free = around(gap)
    start, goal = np.array([-1.0, y]), np.array([1.0, y])
    way = search(free, seed).way(start, goal[None])
    assert np.array_equal(way[0], start) and np.array_equal(way[-1], goal)
    for a, b in itertools.pairwise(way):
        for q in line(a, b, STEP / 10):  # between two questions there is no more than half a step
            assert any(free(q + np.array(d)) for d in itertools.product((-STEP, 0.0, STEP), repeat=2))


def test_the_same_request_has_the_same_way_whatever_was_asked_before():
    start, goal = np.array([-1.0, 0.0]), np.array([[1.0, 0.0]])
    first = search(around(0.9)).way(start, goal)
    search(around(0.2), seed=5).way(start, goal)
    again = search(around(0.9)).way(start, goal)
    assert np.array_equal(np.array(first), np.array(again))


def test_a_straight_line_is_taken_where_it_is_clear_to_the_first_goal_that_has_one():
    goals = np.array([[1.0, 0.0], [-1.0, 1.0]])
    way = search(around(0.5)).way(np.array([-1.0, 0.0]), goals)
    assert len(way) == 2 and np.array_equal(way[-1], goals[1])


def test_no_way_ends_after_so_many_questions():
    shut = search(around(9.0))
    assert shut.way(np.array([-1.0, 0.0]), np.array([[1.0, 0.0]])) is None
    assert shut.asked <= 2 * QUESTIONS + 1000


def test_an_end_on_a_limit_is_no_hindrance():
    way = search(around(0.5)).way(np.array([-2.0, -2.0]), np.array([[2.0, -2.0]]))
    assert way is not None and (np.array(way) >= LOW).all() and (np.array(way) <= HIGH).all()


def test_a_way_is_cut_short():
    way = np.array(search(around(0.0)).way(np.array([-1.0, -0.2]), np.array([[1.0, -0.2]])))
    assert np.linalg.norm(np.diff(way, axis=0), axis=-1).sum() < 2.0 * 1.3


def test_points_on_a_line_are_left_out():
    points = [np.array(p, float) for p in ((0, 0), (1, 0), (2, 0), (2, 1))]
    assert len(_without_repeats(points)) == 3


def found(seed):
    return np.array(search(around(0.9), seed).way(np.array([-1.0, 0.0]), np.array([[1.0, 0.0]]))).tolist()


def test_threads_find_the_ways_that_one_finds():
    alone = [found(seed) for seed in range(1, 13)]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(found, range(1, 13))) == alone


def test_others_who_use_ompl_keep_their_messages_and_their_seed():
    from ompl import util

    level = util.getLogLevel()
    try:
        util.setLogLevel(util.LOG_INFO)
        after = []
        for seed in (5, 6, 5):
            util.RNG.setSeed(seed)
            found(1)
            after.append(util.RNG().getLocalSeed())
        assert after[0] == after[2] != after[1]
        assert util.getLogLevel() == util.LOG_INFO
    finally:
        util.setLogLevel(level)
