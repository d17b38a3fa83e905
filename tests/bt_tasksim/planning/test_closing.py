"""What the fingers of a hand of many of them meet when they close, and whether they hold it."""

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.planning.closing import closing_of
from bt_tasksim.planning.things import box_corners
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.kinematics.hand import tips_in_tool

THUMB, INDEX, MIDDLE = 0, 1, 2
ANGLES = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)


@pytest.fixture(scope="module")
def robot():
    return load_robot("xarm7_ability")


@pytest.fixture(scope="module")
def closing(robot):
    return closing_of(robot)


def box(*size):
    return [box_corners(size)]


def rod(radius):
    """A rod along x."""
    ends = [[[x, radius * np.cos(a), radius * np.sin(a)] for a in ANGLES] for x in (-0.05, 0.05)]
    return [np.array(ends).reshape(-1, 3)]


def at(x=0.0, y=0.0, z=0.0):
    return poses.pose([x, y, z])


def test_a_box_is_met_on_both_faces_at_once(closing):
    met = closing.met(at(), box(0.08, 0.045, 0.04))
    assert np.isfinite(met.closure).all()
    assert met.normals[THUMB] == pytest.approx([0, 1, 0], abs=0.1)
    assert met.normals[MIDDLE] == pytest.approx([0, -1, 0], abs=0.1)
    squeeze = closing.squeeze(met)
    assert squeeze.angle < np.radians(12) and abs(squeeze.ahead) < 0.005


def test_fingers_that_come_to_lie_on_the_top_push_a_thing_out(closing):
    deep = closing.squeeze(closing.met(at(), box(0.08, 0.045, 0.04)))
    assert abs(deep.out) < 0.02, "it is held between upright faces"
    wide = box(0.095, 0.09, 0.03)
    on_top = closing.squeeze(closing.met(at(z=0.022), wide))
    assert on_top.out > 0.4 > closing.squeeze(closing.met(at(z=0.0), wide)).out > 0.05, "fingers spread out"


def test_what_is_narrow_is_missed_by_the_outer_fingers(closing):
    met = closing.met(at(), box(0.008, 0.03, 0.04))
    assert np.isfinite(met.closure).tolist() == [True, False, True, False, False]


def test_a_finger_that_meets_a_wall_first_does_not_press_on_what_is_behind_it(closing):
    thing = box(0.08, 0.03, 0.04)
    for side, fingers in ((1.0, [1, 2, 3, 4]), (-1.0, [THUMB])):
        wall = box_corners((0.2, 0.004, 0.04)) + np.array([0.0, 0.022 * side, 0.0])
        met = closing.met(at(), thing, [wall])
        assert np.flatnonzero(np.isinf(met.closure)).tolist() == fingers
        assert closing.squeeze(met) is None
    behind = box_corners((0.2, 0.004, 0.04)) + np.array([0.0, 0.0, 0.06])
    assert np.isfinite(closing.met(at(), thing, [behind]).closure).all()


def test_one_that_stands_aside_is_met_by_one_side_first(closing):
    for aside in (0.012, -0.012):
        squeeze = closing.squeeze(closing.met(at(y=aside), box(0.08, 0.04, 0.04)))
        assert squeeze.ahead == pytest.approx(aside, abs=0.006), "the tool has to follow it"


def test_a_round_thing_is_held_about_its_middle_and_squeezed_out_before_it(closing):
    held = closing.squeeze(closing.met(at(), rod(0.033)))
    out = closing.squeeze(closing.met(at(z=0.028), rod(0.033)))
    assert held.angle < np.radians(20) < np.radians(32) < out.angle


def test_nothing_between_the_fingers_is_no_squeeze(closing):
    assert closing.squeeze(closing.met(at(z=0.2), box(0.04, 0.04, 0.04))) is None


@pytest.mark.parametrize("closure", [0.3, 0.6, 0.9])
def test_fingertips_so_far_apart_have_their_middle_there(robot, closing, closure):
    tips = tips_in_tool(robot, robot.hand_position(np.array([closure])))
    thumb, fingers = tips[0], tips[1:].mean(axis=0)
    middle = closing.middle(np.array([fingers[1] - thumb[1]]))[0]
    assert middle[1:] == pytest.approx(((thumb + fingers) / 2)[1:], abs=5e-4)


def test_a_leaned_hand_reaches_equally_deep_with_both_sides(closing):
    assert 0.05 < closing.lean < 0.2, "the thumb reaches deeper, and is raised"


@pytest.mark.parametrize("width", [0.02, 0.05])
def test_a_hand_closed_about_something_leaves_it_between_its_sides(robot, closing, width):
    closure = float(closing.about(width))

    def gap(closure):
        tips = tips_in_tool(robot, robot.hand_position(np.array([closure])))
        return float(tips[1:, 1].mean() - tips[0, 1])

    assert gap(closure) >= width > gap(closure + 0.05)
    assert closing.about(1.0) == 0.0
