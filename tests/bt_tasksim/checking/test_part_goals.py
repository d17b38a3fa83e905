"""Goals that set a part of furniture to a value ask for something that is not so already."""

import pytest

from bt_tasksim.checking.part_goals import check_part_goals
from bt_tasksim.checking.report import WARNING, Report
from bt_tasksim.scene import FixtureSpec, Goal, Scene


def said(start, draws=3, **goal):
    drawer = FixtureSpec("drawer", parameters={"value": start})
    scene, report = Scene(fixtures=[drawer], goal=Goal("drawer", relation="set", **goal)), Report()
    check_part_goals(scene, [scene.sample(seed) for seed in range(draws)], report)
    assert all((f.level, f.function) == (WARNING, "goal of 'drawer'") for f in report.findings)
    return [f.what for f in report.findings]


STARTS = "is reached before the run in 3 of 3 draws: it starts there"
SHUT = "is reached with 'drawer' shut in 3 of 3 draws"


@pytest.mark.parametrize(
    ("start", "goal", "sentences"),
    [
        (0.1, {"value": 0.1}, [STARTS]),
        (0.1, {"value": 0.03, "position_tolerance": 0.05}, [SHUT]),
        (0.0, {"value": 0.03, "position_tolerance": 0.05}, [STARTS, SHUT]),
        (0.1, {"value": 0.0}, []),
        (0.0, {"value": 0.1}, []),
        (0.1, {"value": 0.1, "when": "kept"}, []),
    ],
)
def test_a_goal_that_is_reached_already_is_a_warning(start, goal, sentences):
    assert said(start, **goal) == sentences


def test_a_start_that_is_drawn_may_meet_the_goal_now_and_then():
    assert said((0.03, 0.17), draws=30, value=0.1) == []
