"""The settings of a training: checked, and back from what a card keeps."""

import dataclasses
import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.core.errors import InputError
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.reward import Reward

configs = st.builds(
    TrainConfig,
    steps=st.integers(1, 10**9),
    seed=st.integers(0, 2**40),
    n_envs=st.integers(1, 64),
    n_steps=st.integers(2, 4096),
    learning_rate=st.floats(1e-6, 1.0),
    hidden=st.lists(st.integers(1, 512), min_size=1, max_size=3).map(tuple),
    log_std=st.floats(-3.0, 1.0),
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
        ({"steps": 0}, "'steps' should be at least 1, found 0"),
        ({"steps": 1e6}, "'steps' should be a whole number"),
        ({"n_envs": True}, "'n_envs' should be a whole number"),
        ({"minibatch": -1}, "'minibatch' should be at least 1"),
        ({"checkpoint_every": 0}, "'checkpoint_every' should be at least 1"),
        ({"seed": -1}, "'seed' should not be negative, found -1"),
        ({"evaluation_draws": 2.5}, "'evaluation_draws' should be a whole number"),
        ({"learning_rate": 0.0}, "'learning_rate' should be positive"),
        ({"final_learning_rate": math.nan}, "'final_learning_rate' should be a number that is finite"),
        ({"clip": math.inf}, "'clip' should be a number that is finite"),
        ({"hidden": ()}, "'hidden' should not be empty"),
        ({"hidden": (64, 0)}, r"'hidden\[1\]' should be at least 1"),
        (
            {"n_envs": 1, "n_steps": 1},
            "a rollout of 'n_envs' times 'n_steps'",
        ),
        ({"gae_lambda": 1.5}, "'gae_lambda' should"),
        ({"entropy": math.nan}, "'entropy' should"),
        ({"log_std": math.nan}, "'log_std' should"),
        ({"stage_share": 0.0}, "'stage_share' should be positive"),
        ({"hidden": (10**6, 10**6)}, r"'hidden\[0\]' should be at most"),
        ({"hidden": (64,) * 100}, "'hidden' should have at most"),
        ({"n_envs": 10**6}, "'n_envs' should be at most"),
        (
            {"n_envs": 4096, "n_steps": 4096},
            "a rollout of 'n_envs' times 'n_steps'",
        ),
        ({"epochs": 10**30}, "'epochs' should be at most"),
        ({"entropy": 1e300}, "'entropy' should be at most"),
        ({"steps": 10**30}, "'steps' should be at most"),
        ({"seed": 2**64}, "'seed' should be below"),
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
        ({"step": 5}, "training: unknown field 'step'; did you mean 'steps'"),
        ({"reward": {"succes": 1.0}}, "training: .*succes"),
        ({"reward": {"gamma": 2.0}}, "'reward.gamma' should be"),
        ({"hidden": 64}, "training: "),
        ({"learning_rate": "fast"}, "training: "),
        ({"reward": 3.0}, "'reward' should be a mapping"),
    ],
)
def test_what_is_no_setting_is_refused(data, says):
    with pytest.raises(InputError, match=says):
        TrainConfig.from_dict(data)


def test_settings_cannot_be_changed_by_the_way():
    with pytest.raises(dataclasses.FrozenInstanceError):
        TrainConfig().steps = 3
