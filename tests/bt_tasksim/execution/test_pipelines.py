"""Engines by name."""

import sys

import pytest

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.registry import parts
from bt_tasksim.engines.base import ROLES
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.engines.perception.state import StatePostProcess
from bt_tasksim.engines.physics.mujoco import MujocoPhysics
from bt_tasksim.engines.physics.sapien import SapienPhysics
from bt_tasksim.execution.pipelines import EngineOptions, build_engine, build_pipeline
from bt_tasksim.robot.description import load_robot


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
        ({"perception": "remote:localhost:5599"}, "remote:localhost:5599"),
        ({"engines": "ros:localhost:9090"}, "tracked"),
        ({"engines": "ros:localhost:9090", "perception": "camera"}, "camera"),
    ],
)
def test_results_say_which_perception_it_was(options, label):
    assert EngineOptions(**options).label == label


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"engines": "mujocco"}, r"unknown physics engine 'mujocco'; did you mean 'mujoco'"),
        ({"engines": "sapiens"}, r"unknown physics engine 'sapiens'; did you mean 'sapien'\?"),
        ({"perception": "camra"}, r"unknown postprocess engine 'camra'; did you mean 'camera'\?"),
        ({"noise": "nome"}, r"unknown noise model 'nome'; did you mean 'none'\?"),
        ({"kinematics": "pinochio"}, r"unknown kinematics engine 'pinochio'; did you mean 'pinocchio'\?"),
        ({"renderer": "sapient"}, r"unknown rendering engine 'sapient'; did you mean 'sapien'\?"),
        ({"engines": "ros:here"}, "'ros:here' should read ros:HOST:PORT, such as ros:127.0.0.1:9090"),
        ({"engines": "ros:here:0"}, "'ros:here:0' should end with a port from 1 to 65535"),
        ({"renderer": "ros:here:1"}, "unknown rendering engine 'ros'"),
        ({"engines": "remote:here"}, "'remote:here' should read remote:HOST:PORT"),
        ({"renderer": "remote:here:0"}, "'remote:here:0' should end with a port from 1 to 65535"),
        ({"engines": "sapien:here:1"}, "the physics engine 'sapien' takes no address"),
        ({"timeout": 0.0}, "a time-out is a positive number of seconds"),
        ({"connect_timeout": 1e9}, "a time-out is a positive number of seconds"),
        ({"timeout": float("nan")}, "a time-out is a positive number of seconds"),
    ],
)
def test_unknown_names_are_refused_with_the_nearest(options, sentence):
    with pytest.raises(InputError, match=sentence):
        EngineOptions(**options)


def test_options_say_whether_an_engine_is_elsewhere():
    assert not EngineOptions().remote
    for where in ("engines", "perception", "kinematics", "renderer"):
        assert EngineOptions(**{where: "remote:localhost:5599"}).remote


def test_every_name_of_a_role_can_be_built():
    for role in ROLES:
        for name, engine in parts(f"engine/{role}").items():
            assert engine.role == role
            needs_more = engine.takes_address or name == "maniskill"  # a server, or an environment
            if role != "rendering" and not needs_more:  # that needs a device to draw with
                assert type(build_engine(role, name, load_robot("panda"))) is engine
    with pytest.raises(InputError, match=r"unknown role of an engine 'physic'; did you mean 'physics'\?"):
        build_engine("physic", "sapien", load_robot("panda"))
    with pytest.raises(InputError, match="unknown physics engine 'pinocchio'; known: "):
        build_engine("physics", "pinocchio", load_robot("panda"))


def test_what_is_not_installed_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "zmq", None)
    for name in [n for n in sys.modules if n.startswith("bt_tasksim.engines.remote.")]:
        monkeypatch.delitem(sys.modules, name)
    with pytest.raises(MachineError, match=r"need the extra 'remote' .*pip install 'bt-tasksim\[remote\]'"):
        build_pipeline(load_robot("panda"), EngineOptions(engines="remote:localhost:5599"))


def test_a_robot_is_guarded_and_in_real_time():
    line = build_pipeline(load_robot("panda"), EngineOptions(engines="ros:127.0.0.1:9090", noise="hard"))
    assert line.real and type(line.physics).__name__ == "GuardedRobot" and line.rendering is None
    assert line.postprocess.noise.name == "none"  # the tracking system has errors of its own
    assert line.hidden() is None
    line.close()
    images = build_pipeline(
        load_robot("panda"), EngineOptions(engines="ros:127.0.0.1:9090", perception="camera")
    )
    assert images.postprocess.errors.constant == 0.0 and type(images.rendering).__name__ == "RosCameras"


@pytest.mark.parametrize(
    ("robot", "options", "sentence"),
    [
        ("panda", {"rendering": True}, "leave --video away"),
        ("panda", {"perception": "remote:localhost:1"}, "a robot's perception runs in this process"),
        ("panda", {"kinematics": "remote:localhost:1"}, "a robot's kinematics runs in this process"),
        ("panda", {"ros": "nowhere.yaml"}, r"no file 'nowhere\.yaml'"),
        ("so100", {}, "no file says how 'so100' speaks ROS"),
        ("xarm7_ability", {"perception": "camera"}, "names no cameras"),
    ],
)
def test_what_a_robot_cannot_have(robot, options, sentence):
    with pytest.raises(InputError, match=sentence):
        build_pipeline(load_robot(robot), EngineOptions(engines="ros:127.0.0.1:9090", **options))
