"""A scene is drawn, reached, held and stood still before anybody writes a tree for it."""

from __future__ import annotations

import re

import pytest

from bt_tasksim import Fixture, Goal, InputError, ObjectSpec, Scene, SpotSpec
from bt_tasksim.checking.kinds import check_file
from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.checking.scene_file import DRAWS, check_scene
from bt_tasksim.checking.scene_goals import check_together
from bt_tasksim.checking.scene_reach import check_goals
from bt_tasksim.checking.scene_room import check_room
from bt_tasksim.core.resources import asset
from bt_tasksim.trees.load import load_source

WIDE = ((0.09, 0.10, 0.08), (0.10, 0.11, 0.09))
HERE = {"area": (0.02, 0.02)}


@pytest.mark.parametrize("name", ["pick_and_place", "shelf_to_shelf", "pick_and_throw"])
def test_the_scenarios_have_no_errors(name):
    report = check_scene(load_source(name).scene)
    assert not report.errors, report.lines()
    assert "50 of 50 draws" in report.checked[0]


def only(report, thing):
    return [(f.level, f.what) for f in report.findings if f.function == thing]


def test_what_the_hand_cannot_hold_or_the_arm_not_reach_is_named():
    report = check_scene(
        Scene(objects={
            "pack": ObjectSpec(("box",), on="table", size=WIDE, **HERE),
            "far": ObjectSpec(("cube",), on="table", centre=(0.40, 0.50), **HERE),
            "cup": ObjectSpec(("cup",), on="table", centre=(0.0, -0.3), **HERE),
        })
    )  # fmt: skip
    (pack,), (far,) = only(report, "pack"), only(report, "far")
    assert (
        pack[0] == ERROR
        and "in 6 of 6 draws, and the hand of panda, which opens to 80 mm, takes less than 76" in pack[1]
    )
    assert far == (ERROR, "is out of reach on 'table' in 6 of 6 draws, from above")
    assert not only(report, "cup"), report.lines()


def test_what_is_drawn_beyond_its_place_and_falls_is_named():
    report = check_scene(
        Scene(
            fixtures=["stand"],
            objects={"box": ObjectSpec(("box",), on="stand", centre=(0.11, 0.0), area=(0.0, 0.0))},
        )
    )
    said = only(report, "box")
    assert (ERROR, "stands beyond the edge of 'stand' in 50 of 50 draws") in said
    assert any("moves by" in what and "tilts by" in what for _, what in said), report.lines()


def test_goals_that_cannot_be_are_named():
    scene = Scene(
        objects={"box": "on table"},
        spots=[SpotSpec("coin", on="table", centre=(0.4, 0.5), area=(0.0, 0.0), extent=(0.02, 0.02))],
        goal=Goal("box", "coin"),
    )
    said = only(check_scene(scene), "goal of 'box'")
    assert [level for level, _ in said] == [WARNING, ERROR], "a spot is a mark, and bears nothing"
    assert "too small for it in 6 of 6 draws" in said[0][1] and "out of reach on 'coin'" in said[1][1]


@pytest.mark.parametrize(
    "goal",
    [
        Goal("box", "coin", relation="pressed"),
        Goal("box", "coin", when="once"),
        Goal("box", "coin", relation="oriented", value=0.0),
    ],
)
def test_a_mark_on_which_nothing_has_to_stand_may_be_small(goal):
    scene = Scene(
        objects={"box": "on table"}, spots=[SpotSpec("coin", on="table", extent=(0.02, 0.02))], goal=goal
    )
    report = Report()
    check_goals(scene, [scene.sample(seed) for seed in range(2)], report)
    assert not report.findings


def in_the_robot(robot="panda", **scene):
    made, report = Scene(robot, **scene), Report()
    check_room(made, [made.sample(seed) for seed in range(2)], report)
    return [(f.level, f.function, f.what) for f in report.findings]


def test_what_stands_in_the_robot_is_named():
    objects = {
        "far": ObjectSpec("box", on="table", **HERE),
        "near": ObjectSpec("box", on="table", centre=(-0.55, 0.0), **HERE),
    }
    (furniture,) = in_the_robot(fixtures=[Fixture("stand", at=(0.02, 0.0))])
    (thing,) = in_the_robot(objects=objects)
    assert furniture[:2] == (ERROR, "fixture 'stand'") and "mm in 'panda_link" in furniture[2]
    assert thing[:2] == (ERROR, "near") and "of panda in 2 of 2 draws" in thing[2]


@pytest.mark.parametrize("robot", ["panda", "so100"])
def test_furniture_beside_a_robot_is_let_alone(robot):
    assert not in_the_robot(robot, fixtures=["shelf"], objects={"box": "on table"})


def together(goals, fixtures=("shelf",), **objects):
    scene = Scene(fixtures=list(fixtures), objects=objects, goals=goals)
    worlds = [scene.sample(seed) for seed in range(3)]
    report = Report()
    check_together(scene, worlds, report)
    return [finding.what for finding in report.findings if finding.level == ERROR]


THREE = {
    "a": ObjectSpec("cube", on="table"),
    "b": ObjectSpec("cube", on="table"),
    "c": ObjectSpec("cube", on="table"),
}


@pytest.mark.parametrize(
    ("goals", "words"),
    [
        ([Goal("a", on="upper_board"), Goal("a", on="lower_board")], "different heights"),
        ([Goal("a", "upper_board", "anywhere"), Goal("a", on="table")], "too far apart|different heights"),
        ([Goal("a", relation="lifted"), Goal("a", on="table")], "in the hand in one, and let go"),
        ([Goal("a", relation="lifted"), Goal("b", relation="lifted")], "one hand holds one object"),
        ([Goal("a", relation="lifted"), Goal("a", relation="lifted", height=0.1)], "different heights"),
        ([Goal("a", on="b"), Goal("b", on="c"), Goal("c", on="a")], "round in a circle"),
        (
            [
                Goal("a", on="table", position_tolerance=0.005),
                Goal("b", on="table", position_tolerance=0.005),
            ],
            "cannot both stand on the middle",
        ),
    ],
)
def test_goals_that_exclude_each_other_are_named(goals, words):
    (what,) = together(goals, **THREE)
    assert re.search(words, what), what


@pytest.mark.parametrize("relation", ["on", "anywhere", "inside"])
def test_what_bears_one_another_goes_round_in_a_circle(relation):
    bowls = {name: ObjectSpec("bowl", on="table") for name in ("a", "b")}
    found = together([Goal("a", "b", relation), Goal("b", "a", relation)], **bowls)
    assert any("round in a circle" in what for what in found), found


@pytest.mark.parametrize(
    "goals",
    [
        [Goal("a", on="upper_board", when="once"), Goal("a", on="lower_board")],
        [Goal("a", on="b"), Goal("b", on="c"), Goal("c", on="table")],
        [Goal("a", on="table"), Goal("a", "table", "anywhere"), Goal("a", beside="b")],
        [Goal("a", "table", "anywhere"), Goal("b", "table", "anywhere")],
        [Goal("a", relation="lifted"), Goal("b", on="table")],
    ],
)
def test_goals_that_go_together_are_let_alone(goals):
    assert together(goals, **THREE) == []


def of_drawer(*asked):
    return [Goal("drawer", relation=relation, value=value) for relation, value in asked]


@pytest.mark.parametrize(
    ("asked", "possible"),
    [
        ((("open", None), ("shut", None)), False),
        ((("open", 0.1), ("set", 0.05)), False),
        ((("set", 0.05), ("set", 0.12)), False),
        ((("open", 0.1), ("set", 0.15)), True),
        ((("open", 0.1), ("open", None)), True),
    ],
)
def test_a_part_cannot_stand_both_ways(asked, possible):
    found = together(of_drawer(*asked), fixtures=["chest"])
    assert (found == []) == possible
    assert all("cannot stand both ways" in what for what in found)


def test_draws_that_fail_are_counted(monkeypatch):
    assert DRAWS == 50
    monkeypatch.setattr("bt_tasksim.checking.scene_file.DRAWS", 12)  # whose every try takes its time
    crowd = {name: ObjectSpec(("box",), on="table", area=(0.1, 0.1)) for name in "abcdefgh"}
    report = check_scene(Scene(objects=crowd))
    draws = only(report, "draws")
    assert any(level == WARNING and "of 12 draws, such as with seed" in what for level, what in draws), (
        report.lines()
    )
    hopeless = {name: ObjectSpec(("box",), on="table", area=(0.0, 0.0)) for name in "ab"}
    assert only(check_scene(Scene(objects=hopeless)), "draws") == [
        (ERROR, "fails in 12 of 12 draws, such as with seed 0")
    ]


def test_what_a_file_is_is_told_by_its_content(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bottle = check_file(str(asset("scenes", "bottle_on_table.yaml")))
    assert bottle.checked[0].startswith("scene bottle_on_table, 2 objects for panda")
    (tmp_path / "room.py").write_text(
        "from bt_tasksim import Scene\n"
        "def scene(robot='panda'):\n    return Scene(robot, objects={'cup': 'on table'})\n"
    )
    assert check_file("room.py", robot="so100").checked[0].startswith("scene scene, 1 object for so100")
    with pytest.raises(InputError, match="is furniture"):
        check_file(str(asset("fixtures", "shelf.yaml")))
    (tmp_path / "other.yaml").write_text("name: nothing\n")
    with pytest.raises(InputError, match=r"neither a robot's file .* nor a scene's"):
        check_file("other.yaml")
    with pytest.raises(InputError, match="no robot 'pandda'; did you mean 'panda'"):
        check_file("pandda")
    with pytest.raises(InputError, match=r"there is no file 'none\.yaml'"):
        check_file("none.yaml")
