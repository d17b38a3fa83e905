"""What a file is, and what is checked of it: a tree with its scene."""

import pytest

from bt_tasksim import InputError
from bt_tasksim.checking.kinds import check_file
from bt_tasksim.checking.report import ERROR
from bt_tasksim.concept_nodes import Grasp, OpenDoor, OpenDrawer
from bt_tasksim.trees import sequence
from bt_tasksim.trees.xml_writer import save_tree


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save_tree(sequence("pull", Grasp("drawer"), OpenDrawer("drawer")), "pull.xml")
    (tmp_path / "room.yaml").write_text("fixtures: [chest]\ngoal: {object: drawer, relation: open}\n")
    return tmp_path


def test_a_tree_of_xml_is_checked_in_the_scene_that_is_named(here):
    report = check_file("pull.xml", scene="room.yaml")
    assert [words.partition(",")[0] for words in report.checked] == ["scene room", "tree pull"]
    assert not report.errors, report.lines()


def test_a_tree_of_xml_is_checked_in_a_ready_made_scene_that_has_what_it_names(here):
    save_tree(sequence("turn", Grasp("drawer"), OpenDoor("drawer")), "turn.xml")
    report = check_file("turn.xml")
    assert [(f.level, f.remedy) for f in report.findings] == [
        (ERROR, "use OpenDrawer, which moves what slides")
    ]


def test_a_tree_without_a_scene_asks_for_one(here):
    save_tree(sequence("pull", Grasp("no_such_thing")), "other.xml")
    with pytest.raises(InputError, match=r"'other\.xml' does not say in which scene it runs.*with --scene"):
        check_file("other.xml")


def test_what_is_no_tree_has_no_scene_to_be_checked_in(here):
    with pytest.raises(InputError, match=r"--scene is the scene of a tree, and 'room\.yaml' is none"):
        check_file("room.yaml", scene="room.yaml")


def test_a_tree_of_python_is_checked_in_another_scene(here):
    text = "from bt_tasksim.concept_nodes import Grasp\ndef build():\n    return Grasp('drawer')\n"
    (here / "grab.py").write_text(text)
    report = check_file("grab.py", scene="room.yaml")
    assert "tree grab, 1 node:" in report.checked[1]
