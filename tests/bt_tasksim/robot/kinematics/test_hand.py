"""Hands of which one side stands still: where things belong in them, and how deep they reach."""

import numpy as np
import pytest

from bt_tasksim import load_robot
from bt_tasksim.planning.hand_collision import beyond
from bt_tasksim.robot.kinematics.hand import (
    SLIDE,
    SPARE,
    depth_at,
    opened_about,
    shorter_at,
    standing_side,
    swung_at,
    wide_at,
)

WIDTHS = np.array([0.01, 0.028, 0.04, 0.06])


@pytest.mark.parametrize("name", ["panda", "xarm7_ability"])
def test_where_all_fingers_move_every_width_is_held_as_deep(name):
    robot = load_robot(name)
    assert standing_side(robot) is None
    assert (depth_at(robot, WIDTHS) == robot.depth).all()


def test_a_jaw_that_swings_holds_wide_things_less_deep():
    robot = load_robot("so100")
    assert (depth_at(robot, WIDTHS) == robot.depth * np.array([1.0, 1.0, 0.5, 0.5])).all()


def test_it_comes_down_clear_of_what_it_then_slides_up_to():
    robot = load_robot("so100")
    tip = -0.015  # of the jaw that stands still, along the tool's y axis
    assert abs(standing_side(robot) - tip) > SLIDE


def test_its_jaws_end_beyond_the_tools_origin():
    assert beyond(load_robot("so100")) == pytest.approx(0.015, abs=2e-3)


def test_a_jaw_that_swings_leans_and_reaches_less_deep_the_wider_it_is_open():
    robot = load_robot("so100")
    assert swung_at(robot, WIDTHS)[:2] == pytest.approx(0.0, abs=1e-3)
    assert 0.1 < swung_at(robot, WIDTHS)[2] < swung_at(robot, WIDTHS)[3] < 0.6
    assert shorter_at(robot, WIDTHS)[1] == pytest.approx(0.0, abs=1e-3)
    assert shorter_at(robot, WIDTHS)[3] == pytest.approx(7e-3, abs=1e-3)


def test_it_opens_no_wider_than_it_has_to():
    robot = load_robot("so100")
    for width in (0.01, 0.028, 0.04):
        opened = float(robot.closure(opened_about(robot, width)))
        assert width + SPARE <= wide_at(robot, opened) + 1e-9 < width + SPARE + 6e-3
        assert opened > float(robot.closure(opened_about(robot, width + 0.01)))
    assert (opened_about(robot, 0.07) == robot.hand_open).all()


@pytest.mark.parametrize("name", ["panda", "xarm7_ability"])
def test_where_all_fingers_move_the_hand_opens_all_the_way(name):
    robot = load_robot(name)
    assert (opened_about(robot, 0.01) == robot.hand_open).all()
    assert (swung_at(robot, WIDTHS) == 0.0).all() and (shorter_at(robot, WIDTHS) == 0.0).all()
