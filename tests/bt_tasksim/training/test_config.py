"""The settings of a training: checked, and back from what a card keeps."""

import dataclasses
import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.errors import InputError
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.reward import Reward

configs = st.builds(
    TrainConfig,
    steps=st.integers(1, 10**9),
    seed=st.integers(0, 2**40),
    lanes=st.integers(1, 64),
    lane_steps=st.integers(2, 4096),
    learning_rate=st.floats(1e-6, 1.0),
    hidden=st.lists(st.integers(1, 512), min_size=1, max_size=3).map(tuple),
    log_deviation=st.floats(-3.0, 1.0),
    evaluate_every=st.integers(0, 9),
    reward=st.builds(Reward, shaping=st.floats(0.0, 2.0), sufficient=st.booleans()),
)


@given(configs)
def test_what_a_card_keeps_gives_the_same_settings(config):
    assert TrainConfig.from_dict(json.loads(json.dumps(config.to_dict()))) == config


@given(configs)
def test_rollouts_reach_the_steps_and_no_further_than_they_must(config):
    assert (config.rollouts - 1) * config.rollout < config.steps <= config.rollouts * config.rollout


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"steps": 0}, "'steps' should be a positive whole number, found 0"),
        ({"steps": 1e6}, "'steps' should be a positive whole number"),
        ({"lanes": True}, "'lanes' should be a positive whole number"),
        ({"minibatch": -1}, "'minibatch' should be a positive"),
        ({"checkpoint_every": 0}, "'checkpoint_every' should be a positive"),
        ({"seed": -1}, "'seed' should be zero or a positive whole number, found -1"),
        ({"evaluation_draws": 2.5}, "'evaluation_draws' should be zero or"),
        ({"learning_rate": 0.0}, "'learning_rate' should be positive"),
        ({"final_learning_rate": math.nan}, "'final_learning_rate' should be positive"),
        ({"clip": math.inf}, "'clip' should be positive"),
        ({"hidden": ()}, r"'hidden' should hold sizes of layers, found \(\)"),
        ({"hidden": (64, 0)}, "'hidden' should hold sizes"),
        ({"lanes": 1, "lane_steps": 1}, "a rollout needs two decisions at least"),
        ({"gae_lambda": 1.5}, "'gae_lambda' should"),
        ({"entropy": math.nan}, "'entropy' should"),
        ({"log_deviation": math.nan}, "'log_deviation' should"),
        ({"lesson_share": 0.0}, "'lesson_share' should be above 0"),
        ({"terminate_bias": math.inf}, "'terminate_bias' should"),
    ],
)
def test_what_makes_no_sense_is_refused(changes, says):
    with pytest.raises(InputError, match=f"training: {says}"):
        TrainConfig(**changes)
    with pytest.raises(InputError, match=f"training: {says}"):
        TrainConfig.from_dict(changes)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        ({"step": 5}, "training: unknown setting 'step'; did you mean 'steps'"),
        ({"reward": {"succes": 1.0}}, "training: .*succes"),
        ({"reward": {"gamma": 2.0}}, "'gamma' should be"),
        ({"hidden": 64}, "training: "),
        ({"learning_rate": "fast"}, "training: "),
        ({"reward": 3.0}, "'reward' should be a Reward, found 3.0"),
    ],
)
def test_what_is_no_setting_is_refused(data, says):
    with pytest.raises(InputError, match=says):
        TrainConfig.from_dict(data)


def test_settings_cannot_be_changed_by_the_way():
    with pytest.raises(dataclasses.FrozenInstanceError):
        TrainConfig().steps = 3
