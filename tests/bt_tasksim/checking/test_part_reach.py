"""Parts of furniture are taken by their own grasps, and one without any by none."""

import pytest

from bt_tasksim.checking.report import ERROR, Report
from bt_tasksim.checking.scene_reach import check_objects
from bt_tasksim.scene import FixtureSpec, Scene


def said(*fixtures):
    scene, report = Scene(fixtures=list(fixtures)), Report()
    check_objects(scene, [scene.sample(seed) for seed in range(2)], report)
    return [(f.level, f.function, f.what) for f in report.findings]


@pytest.mark.parametrize("fixture", ["button", "chest", "door", "valve"])
def test_ready_made_furniture_is_let_alone(fixture):
    assert said(fixture) == []


def test_a_part_that_is_too_far_away_is_named():
    ((level, part, what),) = said(FixtureSpec("valve", parameters={"x": 1.4}))
    assert (level, part) == (ERROR, "valve")
    assert what == "is out of reach by its own grasps in 2 of 2 draws"
