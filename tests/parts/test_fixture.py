"""A fixture from outside of the package, in one file, through Python and the command line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from draws import successes

from bt_tasksim import Goal, Runner, Scene
from bt_tasksim.cli.main import main
from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Release
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import register, scratch
from bt_tasksim.core.resources import asset
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.specs import ObjectSpec
from bt_tasksim.trees import save_tree, sequence

PLUGIN = Path(__file__).parent / "plugins" / "fixture.py"


def tree() -> object:
    return sequence(
        "onto the pedestal",
        Grasp("cup"),
        Pick("cup", distance=0.25),
        Bring("cup", to="pedestal_top"),
        Place("cup", on="pedestal_top"),
        Release("cup"),
    )


def scene() -> Scene:
    cup = ObjectSpec(kinds=("cup",), on="table", centre=(0.0, -0.12))  # a hand's width from the pedestal
    goal = Goal("cup", "pedestal_top")
    return Scene("panda", fixtures=["pedestal"], objects={"cup": cup}, goal=goal, name="pedestal")


def test_it_stands_in_a_scene(plugin):
    with pytest.raises(InputError, match="unknown fixture 'pedestal'"):
        scene()
    plugin("fixture")
    world = scene().sample(0)
    place = next(place for place in world.places if place.name == "pedestal_top")
    assert np.allclose(place.pose[:3], [0.5, 0.25, 0.12]) and place.fixture == "pedestal"
    with pytest.raises(InputError, match="did you mean 'pedestal'"):
        load_fixture("pedestral")


@pytest.mark.parametrize("engine", ["sapien", "mujoco"])
def test_things_are_set_down_on_it_in_either_physics(plugin, engine):
    """Of three draws at least two succeed: a share, and not one chaotic draw."""
    plugin("fixture")
    runner = Runner(tree(), scene(), EngineOptions(engines=engine, noise="none"))
    successes(runner.run, range(3), n=2)


def test_the_command_line_takes_a_scene_with_it(plugin, tmp_path, capsys):
    file, xml = tmp_path / "scene.yaml", tmp_path / "tree.xml"
    file.write_text("robot: panda\nfixtures: [pedestal]\nobjects:\n  cup: {on: table}\n")
    plugin("fixture")
    save_tree(tree(), xml)
    words = ["show", str(xml), "--scene", str(file)]
    assert main([*words, "--plugin", str(PLUGIN)]) == 0
    assert "pedestal_top" in capsys.readouterr().out


def test_without_the_plugin_the_command_line_says_what_is_missing(tmp_path, capsys):
    file = tmp_path / "scene.yaml"
    file.write_text("robot: panda\nfixtures: [pedestal]\nobjects:\n  cup: {on: table}\n")
    assert main(["run", "pick_and_place", "--scene", str(file)]) == 2
    assert "pedestal" in capsys.readouterr().err


def test_the_path_of_a_data_file_does_as_well():
    with scratch():
        register("fixture", "rack")(asset("fixtures", "shelf.yaml"))
        assert load_fixture("rack") == load_fixture("shelf")
