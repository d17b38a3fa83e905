"""A reward part from outside of the package, in one file: `plugins/reward_part.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bt_tasksim import EpisodeEnv, TrainConfig
from bt_tasksim.cli.main import main
from bt_tasksim.core.errors import InputError
from bt_tasksim.training.reward import Reward
from bt_tasksim.training.session import load_settings
from bt_tasksim.trees.load import load_source

FILE = Path(__file__).parent / "plugins" / "reward_part.py"


def paid(reward, motions):
    """What the parts of a reward pay for some decisions of the grasp, which does not say that it is done."""
    source = load_source("grasp_then_pick")
    env = EpisodeEnv(source.build(), source.scene, reward=reward)
    env.reset(options={"draw": 3})
    out = []
    for motion in motions:
        *_, info = env.step(np.append(np.full(env.action_space.shape[0] - 1, motion), 0.0))
        out.append(info["reward"])
    env.close()
    return out


def test_a_term_pays_for_each_decision_by_its_weight(plugin):
    plugin("reward_part")
    steps = paid(Reward(terms={"smoothness": 0.5}), [0.2, 0.2, -0.4])
    assert [parts["smoothness"] for parts in steps] == pytest.approx([0.0, 0.0, -0.5 * 0.36])


def test_without_it_the_reward_is_the_shipped_one(plugin):
    shipped = paid(Reward(), [0.2, -0.4])
    plugin("reward_part")
    with_term = paid(Reward(terms={"smoothness": 0.5}), [0.2, -0.4])
    assert [{k: v for k, v in p.items() if k != "smoothness"} for p in with_term] == shipped


def test_the_settings_file_chooses_and_weights_it(plugin, tmp_path):
    settings = tmp_path / "settings.yaml"
    settings.write_text("reward: {terms: {smoothness: 0.5}}")
    with pytest.raises(InputError, match="smoothness"):
        load_settings(settings)
    plugin("reward_part")
    config = load_settings(settings)
    assert config.reward.weights["smoothness"] == 0.5
    assert TrainConfig.from_dict(config.to_dict()) == config


def test_the_command_line_takes_it(plugin, tmp_path, capsys):
    settings = tmp_path / "settings.yaml"
    settings.write_text(
        "{steps: 16, n_envs: 1, n_steps: 16, epochs: 1, minibatch: 16, evaluation_draws: 0, "
        "reward: {terms: {smoothness: 0.5}}}"
    )
    words = ["train", "grasp_then_pick", "--settings", str(settings), "--out", str(tmp_path / "out")]
    assert main(words) == 2
    assert "smoothness" in capsys.readouterr().err
    assert main([*words, "--plugin", str(FILE)]) == 0
