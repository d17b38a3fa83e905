"""A tree asks of parts of furniture what they can do."""

import pytest

from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.checking.tree_parts import check_parts
from bt_tasksim.concept_nodes import AdjustDrawer, CloseDrawer, Grasp, OpenDoor, OpenDrawer, Release, TurnKnob
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence


def findings(*leaves, fixture="chest", part="drawer"):
    scene = Scene(fixtures=[fixture], goal=Goal(part, relation="shut"), name="it")
    report = Report()
    check_parts(sequence("the tree", Grasp(part), *leaves, Release(part)), scene, report)
    return report.findings


@pytest.mark.parametrize("leaf", [OpenDrawer("drawer", distance=0.9), AdjustDrawer("drawer", distance=0.9)])
def test_a_drawer_that_is_asked_too_far_is_an_error(leaf):
    (found,) = findings(leaf)
    assert found.level == ERROR and found.function == leaf.name
    assert "900 mm" in found.what and "drawer" in found.what


@pytest.mark.parametrize(
    "leaf", [OpenDrawer("drawer"), OpenDrawer("drawer", distance=0.1), CloseDrawer("drawer")]
)
def test_what_it_can_do_is_let_alone(leaf):
    assert findings(leaf) == []


def test_a_part_that_moves_otherwise_is_not_measured_in_its_units():
    assert findings(OpenDoor("drawer", angle=1.2)) == []


def test_a_knob_of_which_only_some_go_so_far_is_a_warning():
    knob = FixtureSpec("knob", parameters={"turns": (1.0, 4.0)})
    (found,) = findings(TurnKnob("knob", angle=2.5), fixture=knob, part="knob")
    assert found.level == WARNING and "of 10 draws" in found.what
