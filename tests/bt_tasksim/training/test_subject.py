"""What an evaluation or a training is of: every file that decides results, by its content."""

import dataclasses
import shutil
import sys

import numpy as np
import pytest
import toys

from bt_tasksim.cli.main import main
from bt_tasksim.core.identity import differing
from bt_tasksim.core.resources import asset
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.robot.description import load_robot
from bt_tasksim.training.evaluation import LONGEST, Job, Player, _subject
from bt_tasksim.training.subject import _world, evaluation_subject, own_code
from bt_tasksim.trees import sequence

TREE = """
from distances_two import FAR

from bt_tasksim.concept_nodes import Grasp, Pick
from bt_tasksim.trees import sequence
from bt_tasksim.trees.scenarios.pick_and_throw import scene


def build():
    return sequence("lift", Grasp("cup"), Pick("cup", distance=FAR()))
"""
HELPER = "def FAR():\n    return 0.05\n"


@pytest.fixture
def tree(tmp_path):
    """A tree's file, and a module beside it that it imports."""
    (tmp_path / "lift.py").write_text(TREE)
    (tmp_path / "distances_two.py").write_text(HELPER)
    path = list(sys.path)
    yield tmp_path / "lift.py"
    sys.path[:] = path
    for name in ("distances_two", "_tree_lift"):
        sys.modules.pop(name, None)


def subject(job):
    with Player(job) as player:
        code = own_code(player.runner.tree, job.tree, job.plugins)
        return evaluation_subject(
            player.runner.tree, player.runner.scene, job.options, {}, code, "evaluation"
        )


def test_an_evaluation_goes_on_only_with_the_same_code(tree, tmp_path, capsys):
    words = ["evaluate", str(tree), "--json", str(tmp_path / "e.json"), "--episodes"]
    assert main([*words, "2"]) == 0
    kept = (tmp_path / "e.json").read_bytes()
    (tmp_path / "distances_two.py").write_text(HELPER.replace("return", "x = 1\n    return"))
    capsys.readouterr()
    assert main([*words, "3", "--resume"]) == 2
    assert "with another module distances_two: go on" in capsys.readouterr().err
    (tmp_path / "distances_two.py").write_text(HELPER)
    tree.write_text(TREE.replace('"lift"', '"lift" + ""'))
    assert main([*words, "3", "--resume"]) == 2
    assert "with another file lift.py: go on" in capsys.readouterr().err
    assert (tmp_path / "e.json").read_bytes() == kept
    tree.write_text(f"# a word more\n{TREE}")
    assert main([*words, "3", "--resume"]) == 0


def test_the_modules_of_a_trees_leaves_count_though_it_has_no_name():
    names = own_code(sequence("toy", toys.Raise(), toys.Check()))
    assert set(names) >= {"module toys"}


def test_an_environments_file_counts_by_its_content(tmp_path):
    pytest.importorskip("mani_skill")
    path = tmp_path / "mine.yaml"
    text = (asset("maniskill") / "PickCube-v1.yaml").read_text()
    path.write_text(text)
    options = EngineOptions(engines=f"maniskill:{path}")
    before = _world(options.own_world())
    path.write_text(text.replace("environment:", "rebuild: false\nenvironment:"))
    assert differing(before, _world(options.own_world())) == "scene"


def test_a_robots_own_urdf_and_meshes_count(tmp_path):
    panda = load_robot("panda")
    urdf = panda.urdf
    for file in urdf.parent.rglob("*"):
        if file.suffix == ".urdf" or file.suffix in (".stl", ".obj", ".glb", ".dae"):
            to = tmp_path / file.relative_to(urdf.parent)
            to.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, to)
    (tmp_path / "mine.yaml").write_text(
        panda.source.read_text().replace(
            next(line for line in panda.source.read_text().splitlines() if line.startswith("urdf:")),
            f"urdf: {urdf.name}",
        )
    )
    scene = dataclasses.replace(toys.SCENE, robot=str(tmp_path / "mine.yaml"))
    before = _world(scene)
    mesh = next(path for path in (tmp_path).rglob("*hand*.stl"))
    with open(mesh, "ab") as file:
        file.write(b"more")
    assert differing(before, _world(scene)) == f"file {mesh.name}"
    text = (tmp_path / urdf.name).read_text()
    (tmp_path / urdf.name).write_text(text + "<!-- more -->\n")
    assert f"file {urdf.name}" in differing(before, _world(scene))
    assert not [name for name in _world(toys.SCENE) if name.startswith("file")], "the package brings them"


def test_an_objects_mesh_counts_by_its_content(tmp_path):
    from bt_tasksim.scene.scene import Scene
    from bt_tasksim.scene.specs import ObjectSpec

    mesh = tmp_path / "thing.stl"
    mesh.write_bytes(b"one")
    size = ((0.05, 0.05, 0.05), (0.05, 0.05, 0.05))
    scene = Scene(objects={"thing": ObjectSpec(("mesh",), "table", size=size, mesh=str(mesh))})
    before = _world(scene)
    mesh.write_bytes(b"two")
    assert differing(before, _world(scene)) == "file thing.stl"


def test_engines_of_a_job_count():
    job = Job("pick_and_throw", options=EngineOptions(noise="none"))
    other = dataclasses.replace(job, options=EngineOptions(noise="hard"))
    assert differing(subject(job), subject(job)) == ""
    assert differing(subject(job), subject(other)) == "choice of engines"


@pytest.mark.parametrize("longest", [60, 60.0, np.float64(60.0)])
def test_equal_longest_times_are_one_and_the_text_is_that_of_earlier_files(longest):
    job = Job("pick_and_throw", longest=longest)
    with Player(job) as player:
        assert _subject(job, player.runner, "evaluation")["longest time of an episode"] == "60 s"


def test_times_that_differ_late_are_told_apart_and_the_usual_one_is_not_said():
    said = []
    for longest in (LONGEST, 60.00001, 1 / 3, 0.5):
        job = Job("pick_and_throw", longest=longest)
        with Player(job) as player:
            said.append(_subject(job, player.runner, "evaluation").get("longest time of an episode"))
    assert said == [None, "60.00001 s", "0.3333333333333333 s", "0.5 s"]


def test_goals_in_another_file_take_part(tree, tmp_path):
    room = tmp_path / "own_room.py"
    room.write_text(
        "from bt_tasksim import Scene\n\ndef near(final):\n    return True\n\n"
        "def scene(robot='panda'):\n    return Scene(robot, objects={'cup': 'on table'}, goals=[near])\n"
    )

    def code():
        with Player(Job(str(tree), scene=str(room))) as player:
            return own_code(player.runner.tree, str(tree), (), player.runner.scene)

    before = code()
    room.write_text(room.read_text().replace("return True", "return False"))
    assert before.keys() == code().keys() and differing(before, code()) == "file own_room.py"
