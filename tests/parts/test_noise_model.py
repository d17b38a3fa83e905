"""A noise model from outside of the package, in one file: `plugins/noise_model.py`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from bt_tasksim.cli.main import main
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import module_of, parts
from bt_tasksim.engines.perception.noise import noise_model
from bt_tasksim.execution.pipelines import EngineOptions

FILE = str(Path(__file__).parent / "plugins" / "noise_model.py")


def test_it_has_a_name_and_draws(plugin):
    module = plugin("noise_model")
    assert noise_model("askew") is module.ASKEW and "askew" in parts("noise model")
    assert module_of("noise model", "askew") == "_plugin_noise_model"
    assert EngineOptions(noise="askew").noise == "askew"
    drawn = module.ASKEW.draw(np.random.default_rng(1), 500)
    assert drawn.shape == (500, 7) and np.allclose(drawn[:, :3].std(axis=0), 0.001, rtol=0.2)
    means = [module.ASKEW.draw(np.random.default_rng(k), 50)[:, 1].mean() for k in range(200)]
    assert np.std(means) == pytest.approx(0.01, rel=0.2)


def test_unknown_without_the_plugin():
    with pytest.raises(InputError, match="unknown noise model 'askew'"):
        EngineOptions(noise="askew")


def test_there_is_one_of_a_name(plugin):
    module = plugin("noise_model")
    from bt_tasksim.engines.perception.noise import NoiseModel, register_noise

    with pytest.raises(InputError, match="noise model 'fine' is there twice"):
        register_noise(NoiseModel("fine", (1.0, 1.0, 1.0), 0.0))
    assert plugin("noise_model").ASKEW == module.ASKEW, "the same file once more is no second one"


@pytest.mark.physical
def test_the_command_line_takes_it(tmp_path, capsys):
    out = tmp_path / "found.json"
    words = ["evaluate", "grasp_then_pick", "--episodes", "2", "--json", str(out), "--noise", "askew"]
    assert main([*words, "--workers", "1"]) == 2
    assert "unknown noise model 'askew'" in capsys.readouterr().err
    assert main([*words, "--workers", "1", "--plugin", FILE]) == 0
    assert "askew" in json.dumps(json.loads(out.read_text()))
