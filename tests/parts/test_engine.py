"""Engines of each role from outside of the package, one file each, through Python and the command line."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bt_tasksim import Runner, Scene
from bt_tasksim.cli.main import main
from bt_tasksim.concept_nodes import Release, Wait
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.world import Command
from bt_tasksim.execution.pipelines import EngineOptions, build_pipeline, local_engines
from bt_tasksim.hardware.safety.guarded_robot import GuardedRobot
from bt_tasksim.robot.description import load_robot
from bt_tasksim.trees import save_tree, sequence
from bt_tasksim.trees.load import load_source

FOLDER = Path(__file__).parent / "plugins"
SCENE = Scene("panda", objects={"cup": "on table"}, name="a cup")


def draw_back(height: float = 0.1) -> object:
    return sequence("draw back", Release("cup", retreat=height))


@pytest.fixture
def command(plugin, tmp_path):
    """Runs a tree that draws back from a cup, with a plugin; returns the exit code and the result."""
    scene, tree = tmp_path / "scene.yaml", tmp_path / "tree.xml"
    scene.write_text("robot: panda\nfixtures: [table]\nobjects:\n  cup: {on: table}\n")
    save_tree(draw_back(), tree)

    def run(stem, *words):
        out = tmp_path / "out"
        file = str(FOLDER / f"{stem}.py")
        code = main(
            ["run", str(tree), "--scene", str(scene), "--out", str(out), "--plugin", file, *map(str, words)]
        )
        return code, json.loads((out / "result.json").read_text()), out

    return run


def test_kinematics(plugin, command):
    plugin("kinematics_engine")
    runner = Runner(draw_back(), SCENE, EngineOptions(engines="mujoco", kinematics="high"))
    assert type(runner.pipeline.kinematics).__name__ == "HighKinematics"
    observation = runner.pipeline.reset(SCENE.sample(0), SCENE.sample(0).world_model(["a", "b"], 0.08))
    low = observation.tool_pose.copy()
    low[2] = 0.1
    for _ in range(40):
        observation = runner.pipeline.step(Command(tool=low))
    assert observation.tool_pose[2] == pytest.approx(0.25, abs=0.01)
    with pytest.raises(MachineError, match="HighKinematics"):  # what it has not written says so
        runner.pipeline.kinematics.joints_of_hand_start((0.5, 0.0, 0.3, 0.0))
    code, result, _ = command("kinematics_engine", "--kinematics", "high", "--engines", "mujoco")
    assert code == 0 and result["status"] == "SUCCESS"


def test_physics(plugin, command):
    with pytest.raises(InputError, match="unknown physics engine 'ideal'"):
        EngineOptions(engines="ideal")
    plugin("physics_engine")
    result = Runner(draw_back(), SCENE, EngineOptions(engines="ideal")).run(0)
    assert result.status.name == "SUCCESS" and result.verdict is None
    with pytest.raises(InputError, match="did you mean 'ideal'"):
        EngineOptions(engines="idael")
    code, told, _ = command("physics_engine", "--engines", "ideal")
    assert code == 0 and told["engines"] == "ideal"


def test_physics_keeps_the_rate_and_stands_behind_the_guard_like_any_other(plugin):
    plugin("physics_engine")
    result = Runner(draw_back(), SCENE, EngineOptions(engines="ideal", safety=True, real_time=True)).run(0)
    assert result.status.name == "SUCCESS"
    assert result.timing is not None and result.wall_time >= 0.9 * result.sim_time


def test_rendering(plugin, command):
    plugin("rendering_engine")
    world = SCENE.sample(3)
    line = build_pipeline(load_robot("panda"), EngineOptions(rendering=True, renderer="map"))
    line.reset(world, world.world_model(["a", "b"], 0.08))
    picture = line.render("from above").colour
    cup = world.objects[0]
    row, column = ((np.array(cup.pose[:2]) - [0.0, -0.8]) / 0.005).astype(int)
    assert picture[row, column].tolist() == (255 * np.array(cup.colour)).astype(np.uint8).tolist()
    code, _, out = command("rendering_engine", "--rendering", "map", "--video")
    assert code == 0 and (out / "run.mp4").stat().st_size > 1000


def test_post_process(plugin, command):
    source = load_source("pick_and_place")
    plugin("postprocess_engine")
    late = Runner(source.build(), source.scene, EngineOptions(perception="late")).run(7)
    assert late.status.name == "FAILURE", "what is carried seems to lag behind the hand"
    code, told, _ = command("postprocess_engine", "--perception", "late")
    assert code == 0 and told["perception"] == "4 ticks late, noise fine"


def test_a_real_robot_gets_guard_and_clock(plugin, command):
    plugin("robot_engine")
    options = EngineOptions(engines="echo")
    assert options.real and options.remote and "echo" not in local_engines("physics")
    runner = Runner(sequence("s", Wait(0.3)), SCENE, options)
    assert isinstance(runner.pipeline.physics, GuardedRobot) and runner.pipeline.real
    result = runner.run(0)
    assert result.status.name == "SUCCESS" and result.timing is not None
    assert runner.pipeline.physics.engine.held == "the run is over"
    runner.close()
    code, told, _ = command("robot_engine", "--engines", "echo")
    assert code == 0 and told["engines"] == "echo" and told["perception"] == "tracked"
    unsafe = replace(load_robot("panda"), safety=None)
    with pytest.raises(InputError, match="safety"):
        build_pipeline(unsafe, options)


def test_a_real_robot_is_not_served(plugin):
    plugin("robot_engine")
    from bt_tasksim.execution.serving import serve

    with pytest.raises(InputError, match="is a robot"):
        serve("physics", "echo", "panda", "127.0.0.1", 0, say=print, complain=print)


def test_an_engine_from_outside_is_served_to_another_process(plugin):
    file = str(FOLDER / "physics_engine.py")
    words = ["serve-engine", "physics", "ideal", "--port", "0", "--plugin", file]
    server = subprocess.Popen(
        [sys.executable, "-m", "bt_tasksim.cli", *words], stdout=subprocess.PIPE, text=True
    )
    try:
        said = server.stdout.readline()
        port = re.search(r":(\d+)", said).group(1)
        options = EngineOptions(engines=f"remote:127.0.0.1:{port}", timeout=30.0, connect_timeout=30.0)
        runner = Runner(draw_back(), SCENE, options)
        assert runner.pipeline.served == {"physics": "ideal"}
        assert runner.run(0).status.name == "SUCCESS"
        runner.close()
    finally:
        server.kill()
        server.communicate()
