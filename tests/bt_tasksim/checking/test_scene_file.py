"""A scene is drawn, reached, held and stood still before anybody writes a tree for it."""

from __future__ import annotations

import pytest

from bt_tasksim import Goal, InputError, ObjectSpec, Scene, SpotSpec
from bt_tasksim.checking.kinds import check_file
from bt_tasksim.checking.report import ERROR, WARNING
from bt_tasksim.checking.scene_file import check_scene
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
    assert pack[0] == ERROR and "in 6 of 6 draws, and the hand of panda opens to 80 mm" in pack[1]
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
    assert [level for level, _ in said] == [ERROR, ERROR]
    assert "too small for it in 6 of 6 draws" in said[0][1] and "out of reach on 'coin'" in said[1][1]


def test_draws_that_fail_are_counted():
    crowd = {name: ObjectSpec(("box",), on="table", area=(0.1, 0.1)) for name in "abcdefgh"}
    report = check_scene(Scene(objects=crowd))
    draws = only(report, "draws")
    assert any(level == WARNING and "of 50 draws" in what for level, what in draws), report.lines()
    hopeless = {name: ObjectSpec(("box",), on="table", area=(0.0, 0.0)) for name in "ab"}
    assert only(check_scene(Scene(objects=hopeless)), "draws") == [(ERROR, "fails in 50 of 50 draws")]


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
