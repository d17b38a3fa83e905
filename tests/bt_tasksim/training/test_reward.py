"""The laws of what an episode pays."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from bt_tasksim.core.errors import InputError
from bt_tasksim.training.reward import PARTS, Reward
from bt_tasksim.training.reward_parts import Transition

costs = st.floats(0.0, 10.0)
rewards = st.builds(Reward, shaping=st.floats(0.0, 2.0), gamma=st.floats(0.8, 1.0), success=st.just(1.0))


def transition(reward, before, after, end=""):
    return Transition(None, np.zeros(1), None, before, after, reward.gamma, end)


def shaped(reward, before, after):
    return reward.pay(transition(reward, before, after))["shaping"]


def discounted(reward, path):
    """What shaping pays along costs, the first of which is the start's, as the learner counts it."""
    potentials = [path[0] - cost for cost in path]
    pairs = itertools.pairwise(potentials)
    return sum(reward.gamma**t * shaped(reward, before, after) for t, (before, after) in enumerate(pairs))


@given(rewards, st.lists(costs, min_size=2, max_size=40))
def test_shaping_depends_on_the_end_alone(reward, path):
    gained = path[0] - path[-1]
    expected = reward.shaping * reward.gamma ** (len(path) - 1) * gained
    assert discounted(reward, path) == pytest.approx(expected, abs=1e-9)


@given(rewards, costs, st.lists(costs, max_size=40))
def test_a_closed_path_pays_nothing(reward, start, path):
    assert discounted(reward, [start, *path, start]) == pytest.approx(0.0, abs=1e-9)


@given(rewards, st.lists(costs, min_size=2, max_size=40))
def test_no_way_to_a_worse_state_pays(reward, path):
    assume(path[-1] >= path[0])
    assert discounted(reward, path) <= 1e-9


@given(
    rewards, st.lists(costs, min_size=1, max_size=8), st.lists(costs, min_size=1, max_size=8), costs, costs
)
def test_a_detour_to_the_goal_pays_no_more_than_the_way_itself(reward, way, detour, start, end):
    assume(end <= start)
    direct = discounted(reward, [start, *way, end])
    assert discounted(reward, [start, *way, *detour, end]) <= direct + 1e-9


@given(rewards, costs, st.integers(1, 50))
def test_standing_still_pays_nothing(reward, cost, ticks):
    assert discounted(reward, [cost] * (ticks + 1)) == 0.0


@given(st.lists(costs, min_size=1, max_size=40), costs)
def test_a_closed_path_that_comes_nearer_costs_even_without_discount(path, start):
    reward = Reward()
    potentials = [0.0, *(max(0.0, start - cost) for cost in path), 0.0]
    total = sum(shaped(reward, a, b) for a, b in itertools.pairwise(potentials))
    assert total <= 1e-9


def test_without_weight_there_is_no_shaping():
    assert shaped(Reward(shaping=0.0), 0.3, 0.9) == 0.0


ENDS = ("success", "failure", "violated", "timeout", "cut", "")


@given(
    st.builds(
        Reward,
        success=st.floats(0.1, 5.0),
        failure=st.floats(-5.0, 0.0),
        violated=st.floats(-5.0, 0.0),
        timeout=st.floats(-5.0, 0.0),
        shaping=st.floats(0.0, 2.0),
        gamma=st.floats(0.8, 1.0),
    ),
    costs,
    costs,
    st.sampled_from(ENDS),
)
def test_the_parts_pay_what_the_formulas_say(reward, before, after, end):
    """As they were written before there were parts, to the last bit."""
    paid = reward.pay(transition(reward, before, after, end))
    expected = dict.fromkeys(PARTS, 0.0)
    if end in PARTS:
        expected[end] = getattr(reward, end)
    expected["shaping"] = reward.shaping * (reward.gamma * after - before)
    assert paid == expected and list(paid) == list(expected)
    assert sum(paid.values()) == sum(expected.values())
    taken_back = reward.pay(transition(reward, before, 0.0, end))["shaping"]
    assert taken_back == -reward.shaping * before


def test_further_terms_are_named_and_weighted_and_must_exist():
    with pytest.raises(InputError, match="smothness"):
        Reward(terms={"smothness": 1.0})
    with pytest.raises(InputError, match="'shaping' has a field of its own"):
        Reward(terms={"shaping": 1.0})


def test_parts_are_what_is_paid():
    assert PARTS == ("success", "failure", "violated", "timeout", "shaping")


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"gamma": 0.0}, "'gamma' should be positive, found 0"),
        ({"gamma": 1.01}, "'gamma' should be"),
        ({"gamma": math.nan}, "'gamma' should be"),
        ({"success": 0.0}, "'success' should be positive"),
        ({"failure": 0.1}, "'failure' should not be positive"),
        ({"timeout": 0.1}, "'timeout' should not be positive"),
        ({"violated": 0.1}, "'violated' should not be positive"),
        ({"success": math.nan}, "'success' should be a number that is finite"),
        ({"timeout": math.nan}, "finite"),
        ({"shaping": -0.1}, "'shaping' should not be negative, found -0.1"),
        ({"shaping": math.inf}, "finite"),
    ],
)
def test_what_makes_no_sense_is_refused(changes, says):
    with pytest.raises(InputError, match=says):
        Reward(**changes)
