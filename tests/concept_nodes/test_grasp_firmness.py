"""A hand of many fingers is asked whether it holds; one of two holds as the grip says."""

from types import SimpleNamespace

import numpy as np
import pytest

from bt_tasksim.concept_nodes.grasp_firmness import BARELY, HARDLY, SLIPS, SURELY, Firm, deeper
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.things import Thing, box_corners
from bt_tasksim.robot.description import load_robot

DOWN = np.array([0.0, 1.0, 0.0, 0.0])


def firm(robot="xarm7_ability", size=(0.08, 0.045, 0.06), things=()):
    model = SimpleNamespace(solid=None, extent=np.array(size))
    objects = {"box": poses.pose([0.0, 0.0, 0.03])}
    view = SimpleNamespace(
        robot=load_robot(robot), objects=objects, model=lambda name: model, things=lambda without: things
    )
    return Firm(view, "box")


def above(z, x=0.0, y=0.0):
    return poses.pose([x, y, z], DOWN)


def test_it_holds_about_the_middle_barely_at_the_top_and_hardly_beside_it():
    found = firm()
    assert found.holds(above(0.04)) == SURELY
    assert BARELY in {found.holds(above(z)) for z in np.arange(0.05, 0.08, 0.001)}
    assert found.holds(above(0.12)) == HARDLY


def test_what_is_wide_is_pressed_out_of_a_hand_whose_fingers_lie_on_its_top():
    found = firm(size=(0.095, 0.09, 0.03))
    shallow, deep = above(0.04), above(0.03)
    assert found.features(shallow)[0] < SLIPS and found.holds(shallow) == HARDLY
    assert found.holds(deep) == SURELY, "7 mm less deep they hold it, too"


def test_a_grasp_beside_the_middle_is_moved_until_both_sides_meet_at_once():
    found, tool = firm(), above(0.04, y=0.012)
    assert found.holds(tool) == HARDLY, "one side pushes the box along until it meets the other"
    moved = found.centred(tool)
    assert abs(moved[1]) < 0.006 and found.holds(moved) == SURELY
    assert moved[[0, 2]] == pytest.approx(tool[[0, 2]])


def test_fingers_that_would_close_on_a_wall_beside_it_do_not_hold_it():
    def wall(y, height):
        return Thing("wall", poses.pose([0.0, y, height / 2]), (0.3, 0.004, height))

    tool = above(0.04)
    assert firm(things=[wall(0.03, 0.06)]).holds(tool) == HARDLY
    assert firm(things=[wall(-0.03, 0.06)]).holds(tool) == HARDLY
    assert firm(things=[wall(0.09, 0.06)]).holds(tool) == SURELY, "they do not come there"
    assert firm(things=[wall(0.03, 0.004)]).holds(tool) == SURELY, "what bears the box bears the fingers, too"


def test_where_nothing_is_met_nothing_is_moved():
    tool = above(0.2)
    assert firm().centred(tool) is tool


def test_a_level_grasp_goes_on_and_one_from_above_does_not():
    assert deeper(above(0.04)) == pytest.approx(above(0.04))
    level = poses.pose([0.0, 0.0, 0.03], poses.frame_from_axes(np.array([1.0, 0, 0]), np.array([0, 1.0, 0])))
    assert deeper(level)[:3] == pytest.approx([0.01, 0.0, 0.03])


def test_a_gripper_of_two_fingers_is_not_asked():
    found, tool = firm("panda"), above(0.2)
    assert not found.asks and found.holds(tool) == SURELY
    assert found.centred(tool) is tool


def test_a_grasp_is_riskier_beside_the_middle_on_what_is_thin_and_with_a_slanted_squeeze():
    found, middle = firm(), above(0.04)
    least = found.risk(middle, 0.045)
    assert 0.0 <= least < 0.15
    assert found.risk(above(0.04, x=0.03), 0.045) > least + 0.1, "fingers hold its end alone"
    assert found.risk(middle, 0.01) > found.risk(middle, 0.045) == found.risk(middle, np.inf)
    turned = poses.pose([0.0, 0.0, 0.04], poses.quat_multiply(poses.yaw(0.4), DOWN))
    assert found.features(turned)[0] > found.features(middle)[0]
    assert found.risk(turned, 0.045) > least
    assert 0.0 < found.risk(above(0.2), 0.045) < 1.0, "where nothing is met it is as good as lost"
    assert firm("panda").risk(middle, 0.045) == 0.0


def test_what_is_below_the_fingers_does_not_turn_in_them_wherever_the_hand_comes_from():
    found = firm()

    def level(x: float, z: float) -> Array:
        axes = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
        return poses.pose([x, 0.0, z], poses.frame_from_axes(*axes))

    for tool in (above(0.02), above(0.05), level(0.0, 0.02), level(0.0, 0.05)):
        assert found.features(tool)[1] == pytest.approx(0.0, abs=1e-6)
    assert found.features(level(-0.03, 0.04))[1] == pytest.approx(0.03, abs=1e-6)


def upside_down_t(robot):
    """A stem 13 mm wide and 35 mm high on a bar 48 mm long and 13 mm high, in the middle of its box."""
    bar, stem = (
        poses.transform(poses.pose([0.0, 0.0, z]), box_corners(size))
        for z, size in ((-0.0175, (0.048, 0.014, 0.013)), (0.0065, (0.013, 0.009, 0.035)))
    )
    model = SimpleNamespace(solid=SimpleNamespace(pieces=(bar, stem)), extent=np.array([0.048, 0.014, 0.048]))
    objects = {"tee": poses.pose([0.0, 0.0, 0.024])}
    view = SimpleNamespace(
        robot=load_robot(robot), objects=objects, model=lambda name: model, things=lambda without: ()
    )
    return Firm(view, "tee")


def test_a_jaw_that_would_meet_something_else_three_millimetres_lower_is_not_steady():
    """Its tip closes above the bar of a T, or just above it, where the hand may come lower than it should."""
    found = upside_down_t("so100")
    across = poses.frame_from_axes(np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]))
    steady = {z: found.steady(np.array([-0.0065, 0.0, z, *across])) for z in np.arange(0.02, 0.045, 0.001)}
    heights = [z for z, is_so in steady.items() if not is_so]
    assert heights and max(heights) - min(heights) < 0.004, "about the height of the bar alone"
    assert all(steady[z] for z in steady if z > max(heights) + 1e-9)
    assert all(upside_down_t("panda").steady(np.array([0.0, 0.0, z, *across])) for z in steady), "no jaw"
