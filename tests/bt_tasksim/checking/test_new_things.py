"""Trees, scenes and robots that ``bt-tasksim new`` writes work as they are; nothing is written over."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from bt_tasksim import Scene, Session, load_robot, load_scene, run
from bt_tasksim.checking.kinds import check_file
from bt_tasksim.checking.new_robot import write_robot
from bt_tasksim.checking.new_things import write_object, write_scene, write_tree
from bt_tasksim.checking.report import Report
from bt_tasksim.checking.robot_frames import check_frames
from bt_tasksim.cli.main import main
from bt_tasksim.core.errors import InputError
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.trees.load import load_source
from tests.bt_tasksim import small_arm


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_new_tree_runs_in_its_scene_and_in_a_new_one(capsys):
    assert main(["new", "tree", "tidy_up"]) == 0
    assert main(["new", "scene", "kitchen"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("wrote tidy_up.py\nnext: bt-tasksim run tidy_up.py --video; ")
    assert sorted(os.listdir()) == ["kitchen.yaml", "tidy_up.py"]
    assert not any("@" in Path(name).read_text() for name in os.listdir())
    source = load_source("tidy_up.py")
    assert any(run(source.build(), source.scene, seed=seed).success for seed in range(3, 6))
    other = load_source("tidy_up.py", scene="kitchen.yaml")
    assert other.scene.name == "kitchen"
    goal = load_scene("kitchen.yaml").goal
    assert (goal.object, goal.place) == ("cup", "mat")
    assert any(run(other.build(), other.scene, seed=seed).success for seed in range(3, 6))


def test_a_new_scene_has_nothing_to_mend():
    write_scene("kitchen")
    report = check_file("kitchen.yaml")
    assert not report.findings, report.lines()


def test_a_new_object_has_nothing_to_mend_and_goes_into_a_scene():
    assert "bt-tasksim check watering_can.yaml" in write_object("watering_can")
    report = check_file("watering_can.yaml")
    assert not report.findings, report.lines()
    world = Scene(objects={"it": "watering_can.yaml on table"}).sample(0)
    assert world.objects[0].category == "watering_can"


def test_the_tree_beside_a_scene_is_checked_too():
    write_tree("mine")
    assert any("tree mine" in line for line in check_file("mine.py").checked)
    text = Path("mine.py").read_text()
    for k, (right, wrong, sentence) in enumerate((
        ('Pick("cup"', 'Pick("cop"', "no object 'cop'.*did you mean 'cup'"),
        ('to="mat"', 'to="matt"', "no place 'matt'.*did you mean 'mat'"),
        ("distance=", "distanse=", "distanse"),
    )):  # fmt: skip
        assert right in text
        Path(f"other{k}.py").write_text(text.replace(right, wrong))
        with pytest.raises(InputError, match=sentence):
            check_file(f"other{k}.py")


def test_a_new_robot_is_the_panda_to_be_changed():
    assert write_robot("mine").endswith("bt-tasksim check mine.yaml")
    mine, panda = load_robot("mine.yaml"), load_robot("panda")
    assert (mine.name, mine.urdf, mine.joints) == ("mine", panda.urdf, panda.joints)
    for field in ("arm_lower", "rest", "tool_pose", "closing", "hand_open", "task_mask"):
        np.testing.assert_allclose(getattr(mine, field), getattr(panda, field), atol=1e-5, err_msg=field)
    assert (mine.arm_drive, mine.hand_drive, mine.opening) == (
        panda.arm_drive,
        panda.hand_drive,
        panda.opening,
    )


def test_a_robot_is_filled_in_from_its_urdf():
    Path("small.urdf").write_text(small_arm.urdf())
    write_robot("small", urdf="small.urdf")
    robot = load_robot("small.yaml")
    assert robot.base_link == "floor" and robot.arm_joints == tuple(f"j{i}" for i in range(6))
    assert robot.hand_joints == ("left_slide", "right_slide") and robot.tool_link == "l5"
    assert robot.hand_open.tolist() == [0.04, 0.04] and robot.hand_closed.tolist() == [0.0, 0.0]
    assert robot.arm_velocity.tolist() == [1.0, *[2.0] * 5], "the first one states none"
    assert {tip.links for tip in robot.tips} == {("left",), ("right",)}
    tool = PinocchioKinematics(robot).forward(robot.rest)
    assert tool[0] > 0.1, "it rests before the base"
    report = Report()
    check_frames(PinocchioKinematics(robot), report)
    assert not report.findings, report.lines()


def test_a_panda_that_is_filled_in_from_its_urdf_grasps():
    shutil.copytree(load_robot("panda").urdf.parent, "panda")
    write_robot("mine", urdf="panda/panda_v2.urdf")
    robot, panda = load_robot("mine.yaml"), load_robot("panda")
    assert robot.joints == panda.joints and robot.opening == pytest.approx(0.08, abs=0.002)
    report = check_file("mine.yaml")
    assert not report.findings, report.lines()
    source = load_source("pick_and_place", robot="mine.yaml")
    ended = []
    for seed in range(3, 6):
        with Session(source.build, source.scene, seed=seed) as session:
            while session.step():
                pass
            ended.append(session.result.success)
    assert any(ended)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["tree", "Tidy"], "the name of a tree should be lower-case words"),
        (["tree", "class"], "'class' is a word of Python"),
        (["scene", "a-b"], "the name of a scene should be lower-case words"),
        (["robot", ""], "the name of a robot should be lower-case words"),
        (["robot", "mine", "--urdf", "none.urdf"], "there is no URDF 'none.urdf'"),
        (["scene", "mine", "--urdf", "none.urdf"], "new scene: --urdf is for robots"),
        (["tree", "mine", "--like", "push"], "new tree: --like is for concepts"),
        (["fixture", "mine"], "invalid value for 'kind'"),
    ],
)
def test_what_makes_no_sense_writes_nothing(words, said, capsys):
    assert main(["new", *words]) == 2
    err = capsys.readouterr().err
    assert said in err.lower().replace("KIND", "kind") or said in err, err
    assert not os.listdir()


@pytest.mark.parametrize("write", [write_tree, write_scene, write_robot])
def test_nothing_is_written_over(write):
    write("mine")
    (name,) = os.listdir()
    Path(name).write_text("my own")
    with pytest.raises(InputError, match="is there already"):
        write("mine")
    assert Path(name).read_text() == "my own"


def test_a_urdf_elsewhere_and_one_without_a_hand_are_refused(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    Path("a/small.urdf").write_text(small_arm.urdf())
    with pytest.raises(InputError, match="give --out a"):
        write_robot("small", "b", "a/small.urdf")
    Path("a/stick.urdf").write_text('<robot name="stick"><link name="stick"/></robot>')
    with pytest.raises(InputError, match="no chain of joints leads from 'stick' to one hand"):
        write_robot("stick", "a", "a/stick.urdf")
    assert not os.listdir("b") and sorted(os.listdir("a")) == ["small.urdf", "stick.urdf"]


@pytest.mark.parametrize("name", ["trees", "concept_nodes", "json", "numpy", "bt_tasksim"])
def test_a_tree_is_not_called_like_a_module_that_it_would_hide(name):
    with pytest.raises(InputError, match="is installed already: choose another name"):
        write_tree(name)
    assert not os.listdir()
