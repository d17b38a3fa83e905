"""A kind of object from outside, in one file: drawn, simulated, rendered, sent, perceived and carried."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from draws import successes

from bt_tasksim import Goal, Runner, Scene
from bt_tasksim.cli.main import main
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.engines.perception.opencv import CameraPostProcess
from bt_tasksim.engines.remote.configurations import as_received, for_sending
from bt_tasksim.engines.remote.messages import Message, decode, encode
from bt_tasksim.engines.remote.schema import sizes_of
from bt_tasksim.execution.pipelines import EngineOptions, build_pipeline
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.shapes import ShapeSize, object_model, shape
from bt_tasksim.scene.specs import ObjectSpec, SpotSpec
from bt_tasksim.trees.load import load_source

PLUGIN = Path(__file__).parent / "plugins" / "shape.py"
SIZE = ShapeSize((0.06, 0.06, 0.09))


def scene() -> Scene:
    nut = ObjectSpec(kinds=("hexagon",), on="table", centre=(0.0, -0.12))
    goal = SpotSpec("goal", on="table", centre=(0.0, 0.2), area=(0.03, 0.03))
    return Scene("panda", objects={"target": nut}, spots=[goal], goal=Goal("target", "goal"), name="nut")


def test_without_the_plugin_nobody_knows_it():
    with pytest.raises(InputError, match="unknown shape 'hexagon'"):
        scene()


def test_its_geometry_agrees_with_itself(plugin):
    plugin("shape")
    geometry, model = shape("hexagon", SIZE), object_model("nut", "hexagon", SIZE)
    width = SIZE.size[0] * np.cos(np.pi / 6)
    assert geometry.extent == model.extent == pytest.approx((0.06, width, 0.09))
    side = SIZE.size[0] / 2
    assert geometry.volume == pytest.approx(3 * np.sqrt(3) / 2 * side**2 * SIZE.size[2])
    assert np.ptp(geometry.collision[0].corners(), axis=0) == pytest.approx(model.extent)
    assert geometry.surface.nearest(np.array([0.0, 0.1, 0.0])) == pytest.approx([0, width / 2, 0])
    assert model.grasp_widths == pytest.approx([width] * 3) and model.symmetry == 6
    corners = geometry.collision[0].corners()
    assert [np.ptp(corners @ np.array(axis)) for axis in model.grasp_axes] == pytest.approx([width] * 3)


def test_a_slip_of_its_name_is_answered_with_it(plugin):
    plugin("shape")
    with pytest.raises(InputError, match="did you mean 'hexagon'"):
        ObjectSpec(kinds=("hexagone",), on="table")


@pytest.mark.parametrize("engine", ["sapien", "mujoco"])
def test_it_is_grasped_and_set_down_in_either_physics(plugin, engine):
    """Of three draws at least two succeed: a share, and not one chaotic draw."""
    plugin("shape")
    source = load_source("pick_and_place")
    runner = Runner(source.build(), scene(), EngineOptions(engines=engine))
    successes(runner.run, range(3), n=2)


def test_it_is_sent_to_other_processes(plugin):
    plugin("shape")
    robot, world = load_robot("panda"), scene().sample(1)
    sent = Message(1, "reset", {"configuration": for_sending(world, robot)})
    heard = decode(encode(sent, sizes_of(robot)), ["reset"], sizes_of(robot))
    received = as_received(heard.fields["configuration"], robot)
    assert received.objects == world.objects and received.objects[0].kind == "hexagon"


def test_it_is_drawn_and_seen_by_the_camera(plugin):
    plugin("shape")
    robot, world = load_robot("panda"), scene().sample(4)
    try:
        line = build_pipeline(robot, EngineOptions(perception="camera"))
    except MachineError as error:
        pytest.skip(f"no pictures on this machine: {error}")
    assert isinstance(line.postprocess, CameraPostProcess)
    seen = line.reset(world, world.world_model([tip.name for tip in robot.tips], robot.opening))
    assert line.unseen() == {}
    true = np.array(world.objects[0].pose)
    assert np.linalg.norm(seen.objects[0, :3] - true[:3]) < 0.01
    turns = [poses.quat_multiply(true[3:], poses.yaw(np.pi / 3 * k)) for k in range(6)]
    assert min(float(poses.angle_between(seen.objects[0, 3:], turn)) for turn in turns) < np.deg2rad(10)


def test_the_command_line_runs_a_scene_with_it(plugin, tmp_path):
    file = tmp_path / "nut.yaml"
    file.write_text(
        "robot: panda\nfixtures: [table]\nobjects:\n  target: {kind: hexagon, on: table, at: [0.0, -0.12]}\n"
        "spots:\n  - {name: goal, on: table, at: [0.0, 0.2]}\ngoal: {object: target, place: goal}\n"
    )
    words = ["evaluate", "pick_and_place", "--scene", str(file), "--episodes", "3", "--json"]
    assert main([*words, str(tmp_path / "without.json")]) == 2
    assert main([*words, str(tmp_path / "found.json"), "--plugin", str(PLUGIN)]) == 0
    assert json.loads((tmp_path / "found.json").read_text())["successes"] >= 2
