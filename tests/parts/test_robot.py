"""A robot from outside of the package, in one file, through Python and the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from draws import successes

from bt_tasksim import Runner
from bt_tasksim.cli.main import main
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import register, scratch
from bt_tasksim.core.resources import asset
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.robot.description import load_robot
from bt_tasksim.trees.load import load_source

PLUGIN = Path(__file__).parent / "plugins" / "robot.py"


def test_it_is_loaded_by_its_name(plugin):
    with pytest.raises(InputError, match="unknown robot 'near_panda'"):
        load_robot("near_panda")
    plugin("robot")
    mine, panda = load_robot("near_panda"), load_robot("panda")
    begin = [PinocchioKinematics(robot).forward(robot.rest)[0] for robot in (panda, mine)]
    assert begin[0] - begin[1] == pytest.approx(0.1, abs=1e-3)
    with pytest.raises(InputError, match="did you mean 'near_panda'"):
        load_robot("nearpanda")


def test_a_tree_runs_on_it(plugin):
    """Of three draws at least two succeed: a share, and not one chaotic draw."""
    plugin("robot")
    source = load_source("pick_and_place", robot="near_panda")
    runner = Runner(source.build(), source.scene, EngineOptions(noise="none"))
    found = successes(runner.run, range(3), n=2)
    assert {result.configuration.robot for result in found} == {"near_panda"}


def test_the_command_line_takes_it(plugin, tmp_path, capsys):
    words = ["evaluate", "pick_and_place", "--robot", "near_panda", "--episodes", "3", "--noise", "none"]
    assert main([*words]) == 2 and "unknown robot 'near_panda'" in capsys.readouterr().err
    assert main([*words, "--plugin", str(PLUGIN), "--json", str(tmp_path / "found.json")]) == 0
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["robot"] == "near_panda" and found["successes"] >= 2


def test_the_path_of_a_data_file_does_as_well(tmp_path):
    file = tmp_path / "arm.yaml"
    text = asset("robots", "panda.yaml").read_text().replace("name: panda", "name: arm", 1)
    file.write_text(text)
    with scratch():
        register("robot", "arm")(file)
        mine = load_robot("arm")
    assert mine.name == "arm" and np.array_equal(mine.rest, load_robot("panda").rest)
    with pytest.raises(InputError):
        load_robot("arm")
