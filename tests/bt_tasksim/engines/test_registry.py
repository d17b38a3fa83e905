"""Engines by name."""

import pytest

from bt_tasksim.engines.kinematics_pinocchio import PinocchioKinematics
from bt_tasksim.engines.physics_mujoco import MujocoPhysics
from bt_tasksim.engines.physics_sapien import SapienPhysics
from bt_tasksim.engines.postprocess_state import StatePostProcess
from bt_tasksim.engines.registry import EngineOptions, build_pipeline
from bt_tasksim.errors import InputError
from bt_tasksim.robot import load_robot


def test_the_default_is_sapien_with_fine_noise_and_no_images():
    options = EngineOptions()
    assert (options.engines, options.perception, options.noise, options.rendering) == (
        "sapien", "state", "fine", False,
    )  # fmt: skip
    line = build_pipeline(load_robot("panda"), options)
    assert type(line.kinematics) is PinocchioKinematics and type(line.physics) is SapienPhysics
    assert type(line.postprocess) is StatePostProcess and line.postprocess.noise.name == "fine"
    assert line.rendering is None


def test_mujoco_is_chosen_by_its_name():
    line = build_pipeline(load_robot("panda"), EngineOptions(engines="mujoco"))
    assert type(line.physics) is MujocoPhysics and line.rendering is None


@pytest.mark.parametrize(
    ("options", "label"),
    [
        ({}, "state, noise fine"),
        ({"noise": "none"}, "state, noise none"),
        ({"perception": "camera"}, "camera"),
    ],
)
def test_results_say_which_perception_it_was(options, label):
    assert EngineOptions(**options).label == label


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"engines": "mujocco"}, r"unknown engines 'mujocco'; did you mean 'mujoco'\?"),
        ({"engines": "sapiens"}, r"unknown engines 'sapiens'; did you mean 'sapien'\?"),
        ({"perception": "camra"}, r"unknown perception 'camra'; did you mean 'camera'\?"),
        ({"noise": "nome"}, r"unknown noise model 'nome'; did you mean 'none'\?"),
    ],
)
def test_unknown_names_are_refused_with_the_nearest(options, sentence):
    with pytest.raises(InputError, match=sentence):
        EngineOptions(**options)
