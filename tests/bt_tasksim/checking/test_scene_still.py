"""What moves by itself is named: objects that fall, and parts of furniture that go on along their joint."""

import pytest

from bt_tasksim.checking.report import WARNING, Report
from bt_tasksim.checking.scene_still import check_still
from bt_tasksim.scene import FixtureSpec, Scene


def said(kind, **parameters):
    scene, report = Scene(fixtures=[FixtureSpec(kind, parameters=parameters)]), Report()
    check_still(scene, [scene.sample(0)], report)
    return report.findings


@pytest.mark.parametrize(
    ("kind", "parameters", "part", "cause"),
    [
        ("door", {"value": 0.8, "spring": 2.0}, "door", "its spring or its weight"),
        ("lidded_box", {"value": 0.8}, "lid", "its weight"),
    ],
)
def test_a_part_that_its_spring_or_its_weight_takes_away_is_a_warning(kind, parameters, part, cause):
    (found,) = said(kind, **parameters)
    assert (found.level, found.function) == (WARNING, part)
    assert found.what.startswith(f"does not stay at 45.8 degrees: in 1 s {cause} takes it to ")


def test_a_part_that_stays_is_let_alone():
    assert said("drawer", value=0.1) == []
    assert said("door", value=0.8) == []
