"""A tree asks of parts of furniture what they can do."""

import pytest

from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.checking.tree_parts import check_parts
from bt_tasksim.concept_nodes import (
    AdjustDrawer,
    CloseDoor,
    CloseDrawer,
    Grasp,
    IsOpen,
    JointAt,
    OpenDoor,
    OpenDrawer,
    PressButton,
    Release,
    TurnKnob,
    TurnOffStop,
    Turns,
)
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import fallback, sequence


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


@pytest.mark.parametrize(
    ("leaf", "remedy"),
    [
        (OpenDoor("drawer", angle=1.2), "use OpenDrawer, which moves what slides"),
        (CloseDoor("drawer"), "use CloseDrawer, which moves what slides"),
        (TurnKnob("drawer", angle=1.0), "use AdjustDrawer, which moves what slides"),
        (TurnOffStop("drawer", angle=0.1), "name a part that it moves, or take this leaf away"),
    ],
)
def test_a_leaf_for_parts_that_move_otherwise_is_an_error(leaf, remedy):
    (found,) = findings(leaf)
    assert found.level == ERROR and found.function == leaf.name
    assert found.what == "cannot be done in 10 of 10 draws: drawer slides, and does not turn"
    assert found.remedy == remedy


def test_what_turns_is_neither_pulled_nor_pressed():
    one, two = findings(OpenDrawer("door"), PressButton("door"), fixture="door", part="door")
    assert one.level == ERROR and one.remedy == "use OpenDoor, which moves what turns"
    assert two.level == ERROR and two.what.endswith("door turns, and does not slide")


def test_a_tree_that_asks_how_a_part_moves_is_let_alone():
    either = fallback(
        "either", sequence("it turns", Turns("drawer"), OpenDoor("drawer")), OpenDrawer("drawer")
    )
    assert findings(either) == []


def test_what_is_no_part_is_not_opened():
    scene, report = Scene(objects={"cup": "on table"}), Report()
    check_parts(sequence("the tree", OpenDrawer("cup")), scene, report)
    (found,) = report.findings
    assert found.level == ERROR and "cup is no part of furniture" in found.what


def test_leaves_of_one_name_are_told_apart():
    one, two = findings(OpenDrawer("drawer", distance=0.9), OpenDrawer("drawer", distance=0.8))
    assert one.level == two.level == ERROR
    assert (one.function, two.function) == ("opendrawer drawer (leaf 2)", "opendrawer drawer (leaf 3)")
    assert "in 10 of 10 draws" in one.what and "900 mm" in one.what and "800 mm" in two.what


def test_a_knob_of_which_only_some_go_so_far_is_a_warning():
    knob = FixtureSpec("knob", parameters={"turns": (1.0, 4.0)})
    (found,) = findings(TurnKnob("knob", angle=2.5), fixture=knob, part="knob")
    assert found.level == WARNING and "of 10 draws" in found.what


@pytest.mark.parametrize("condition", [IsOpen("door", by=60), JointAt("door", at=60)])
def test_a_condition_in_degrees_is_an_error(condition):
    (found,) = findings(condition, fixture="door", part="door")
    assert found.level == ERROR and found.function == condition.name
    assert "door is asked about at 3437.7 degrees, and it goes from 0.0 degrees to" in found.what
    assert found.what.endswith("only: values are radians, and 60 degrees are 1.05")


def test_a_condition_beyond_the_way_of_what_slides_says_nothing_of_degrees():
    (found,) = findings(IsOpen("drawer", by=60))
    assert "60000 mm" in found.what and "radians" not in found.what


def test_conditions_within_the_way_are_let_alone():
    assert findings(IsOpen("drawer"), IsOpen("drawer", by=0.1), JointAt("drawer", at=0.0)) == []


def test_a_leaf_in_degrees_is_told_the_radians():
    (found,) = findings(TurnKnob("knob", angle=90), fixture="knob", part="knob")
    assert found.level == ERROR and found.what.endswith(": values are radians, and 90 degrees are 1.57")
