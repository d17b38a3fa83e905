"""Objects of one colour: each is found where it is, and what cannot be told apart is never guessed."""

import dataclasses
import math

import numpy as np
import pytest
from raycast import CAMERA, box, image

from bt_tasksim.core import poses
from bt_tasksim.core.errors import NotToldApartError
from bt_tasksim.core.world import WorldState
from bt_tasksim.engines.perception.camera_errors import PERFECT, CameraErrors
from bt_tasksim.engines.perception.looking import Capture, Looker
from bt_tasksim.engines.perception.opencv import CameraPostProcess
from bt_tasksim.engines.perception.segmentation import groups_of_colour
from bt_tasksim.engines.perception.together import between, matched
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import Goal, ObjectSpec

RED = (0.86, 0.16, 0.15)
LOW, TALL, FLAT = (0.05, 0.04, 0.06), (0.05, 0.04, 0.075), (0.09, 0.08, 0.05)
AWAY = poses.pose([0.3, 0.0, 0.5], np.array([0.0, 1.0, 0.0, 0.0]))


def spot(x, y, size, height=0.0, heading=0.0):
    return poses.pose([x, y, height + size[2] / 2], poses.yaw(heading))


def world(sizes, goals=()):
    """Red boxes ``a``, ``b``, ... of given sizes; where they are says each test."""
    spec = {
        name: ObjectSpec(("box",), on="table", size=(size, size), colour=RED)
        for name, size in zip("abcd", sizes, strict=False)
    }
    return Scene("panda", objects=spec, goals=goals).sample(3)


def picture(drawn, where):
    """What the camera sees: ``where`` gives the poses of those that there are, by number."""
    return image([(box(pose, drawn.objects[i].size), RED) for i, pose in where.items()])[0]


def look(drawn, where, before=None, errors=PERFECT, handled=None):
    n = len(drawn.objects)
    looker = Looker(drawn, drawn.world_model(["left", "right"], 0.08), errors, ["scene"])
    known = np.full((n, 7), np.nan)
    for i, pose in (before or {}).items():
        known[i] = pose
    handled = handled or ((False, False),) * n
    return looker.look(Capture({"scene": picture(drawn, where)}, known, handled))


def off(found, i, pose):
    """Metres between where object ``i`` was found and a pose."""
    return float(np.linalg.norm(found.sightings[i].fit.pose[:3] - pose[:3]))


def test_what_explains_most_together_counts_not_what_fits_best_alone():
    assert matched(np.array([[9.0, 8.0], [8.0, 1.0]])) == [(0, 1), (1, 0)]
    assert matched(np.array([[0.0, 0.0], [0.0, 1.0]])) == [(1, 1)]


def test_half_way_between_two_fits_is_for_those_that_agree():
    a, b = poses.pose([0.0, 0.0, 0.0], poses.yaw(0.1)), poses.pose([0.02, 0.0, 0.0], -poses.yaw(0.2))
    middle = between(a, b)
    assert middle[0] == pytest.approx(0.01)
    assert float(poses.angle_between(middle[3:], poses.yaw(0.15))) < 1e-6
    assert between(a, poses.pose([0.0, 0.0, 0.0], poses.yaw(1.0))) is None


def test_colours_that_look_the_same_are_one():
    near = (0.86, 0.17, 0.15)
    assert groups_of_colour([RED, (0.1, 0.4, 0.7), near]) == [[1], [0, 2]]
    assert groups_of_colour([]) == []


@pytest.mark.parametrize("errors", [PERFECT, CameraErrors()])
@pytest.mark.parametrize("first", [0, 1])
def test_each_is_found_by_its_shape_though_the_others_fit_nearly_as_well(first, errors):
    drawn = world([LOW, TALL, FLAT])
    where = {
        first: spot(0.45, -0.1, drawn.objects[first].size, heading=0.3),
        1 - first: spot(0.5, 0.1, drawn.objects[1 - first].size, heading=1.0),
        2: spot(0.6, 0.0, FLAT, heading=0.5),
    }
    found = look(drawn, where, errors=errors)
    assert not found.alike
    assert all(off(found, i, pose) < 0.006 for i, pose in where.items())


def test_one_that_stands_on_another_is_found_though_they_are_one_patch_of_colour():
    drawn = world([FLAT, LOW])
    where = {0: spot(0.5, 0.0, FLAT, heading=0.3), 1: spot(0.505, 0.0, LOW, FLAT[2], heading=0.8)}
    found = look(drawn, where)
    for i, pose in where.items():
        assert off(found, i, pose) < 0.006
        assert poses.z_axis(found.sightings[i].fit.pose[3:])[2] > 0.999


@pytest.mark.parametrize(
    ("low", "high"),
    [
        ((0.08, 0.07, 0.03), (0.06, 0.05, 0.04)),
        ((0.08, 0.07, 0.03), (0.06, 0.05, 0.14)),
        ((0.05, 0.05, 0.05), (0.077, 0.048, 0.109)),  # it overhangs what bears it
    ],
)
def test_of_a_stack_the_lower_one_is_found_first_and_so_the_upper_one_upright(low, high):
    drawn = world([high, low])
    where = {1: spot(0.5, 0.0, low, heading=0.3), 0: spot(0.5, 0.004, high, low[2], heading=0.5)}
    found = look(drawn, where, errors=CameraErrors())
    for i, pose in where.items():
        assert off(found, i, pose) < 0.006
        assert poses.z_axis(found.sightings[i].fit.pose[3:])[2] > 0.999


def test_what_nobody_sees_stays_unseen_and_the_others_are_found():
    drawn = world([LOW, TALL, FLAT])
    where = {0: spot(0.45, -0.1, LOW), 2: spot(0.6, 0.0, FLAT)}
    found = look(drawn, where)
    assert set(found.sightings) == {0, 2} and not found.alike
    assert all(off(found, i, pose) < 0.004 for i, pose in where.items())
    assert "b is not seen" in found.notes[1]


def test_two_of_one_shape_are_refused_by_name_where_it_matters_which_is_which():
    where = {0: spot(0.45, -0.1, LOW), 1: spot(0.5, 0.1, LOW), 2: spot(0.6, 0.0, FLAT)}
    found = look(world([LOW, LOW, FLAT]), where)
    assert found.alike == ((0, 1),) and set(found.sightings) == {2}
    assert "'a'" in found.notes[0] and "'b'" in found.notes[0] and "cannot be told apart" in found.notes[0]


def test_a_single_thing_is_neither_of_two_that_it_may_be():
    found = look(world([LOW, LOW]), {0: spot(0.45, -0.1, LOW)})
    assert found.alike == ((0, 1),) and not found.sightings


def test_two_that_no_goal_tells_apart_may_be_either():
    drawn = world([LOW, LOW, FLAT], [Goal("c", on="table", relation="anywhere")])
    where = {0: spot(0.45, -0.1, LOW), 1: spot(0.5, 0.1, LOW), 2: spot(0.6, 0.0, FLAT)}
    found = look(drawn, where)
    assert not found.alike and off(found, 2, where[2]) < 0.004
    either = sorted(min((off(found, i, where[k]), k) for k in (0, 1)) for i in (0, 1))
    assert {k for _, k in either} == {0, 1} and either[1][0] < 0.004


@pytest.mark.parametrize("turn", [1, -1])
def test_two_of_one_shape_stay_who_they_were_believed_to_be(turn):
    drawn = world([LOW, LOW])
    ends = [spot(0.45, -0.05, LOW), spot(0.45, 0.05, LOW)][::turn]
    before = dict(enumerate(ends))
    pushed = {0: poses.multiply(ends[0], poses.pose([0.006, 0.004, 0.0], poses.yaw(0.1))), 1: ends[1]}
    found = look(drawn, pushed, before)
    assert not found.alike
    assert all(off(found, i, pose) < 0.004 for i, pose in pushed.items())


def test_one_that_is_carried_off_leaves_the_other_alone():
    drawn = world([LOW, LOW])
    before = {0: spot(0.45, -0.05, LOW), 1: spot(0.45, 0.05, LOW)}
    now = {0: spot(0.55, -0.15, LOW, heading=0.4), 1: before[1]}
    found = look(drawn, now, before)
    assert all(off(found, i, pose) < 0.004 for i, pose in now.items())


@pytest.mark.parametrize("low", [0, 1])
def test_nothing_is_taken_for_one_that_is_but_hidden(low):
    drawn = world([LOW, LOW])
    gone, hidden = 1 - low, low
    before = {gone: spot(0.45, -0.1, LOW), hidden: spot(0.45, 0.1, LOW)}
    now = spot(0.6, -0.1, LOW, heading=0.4)
    middle = (CAMERA.pose[:3] + 3 * before[hidden][:3]) / 4
    wall = box(poses.pose(middle, poses.yaw(0.0)), (0.1, 0.1, 0.1))
    seen = image([(box(now, LOW), RED), (wall, (0.5, 0.5, 0.5))])[0]
    looker = Looker(drawn, drawn.world_model(["left", "right"], 0.08), PERFECT, ["scene"])
    known = np.stack([before[0], before[1]])
    found = looker.look(Capture({"scene": seen}, known, ((False, False),) * 2))
    assert set(found.sightings) == {gone} and off(found, gone, now) < 0.004


def test_one_in_the_hand_is_followed_beside_another_of_its_shape():
    drawn = world([LOW, LOW])
    before = {0: spot(0.45, -0.03, LOW, 0.05), 1: spot(0.45, 0.03, LOW)}
    slipped = {0: poses.multiply(before[0], poses.pose([0.0, 0.004, -0.006], poses.yaw(0.05))), 1: before[1]}
    found = look(drawn, slipped, before, handled=((True, True), (False, False)))
    assert all(off(found, i, pose) < 0.004 for i, pose in slipped.items())


@pytest.mark.parametrize("matters", [True, False])
def test_the_first_look_refuses_an_episode_before_anything_moves(matters):
    where = {0: spot(0.45, -0.1, LOW), 1: spot(0.5, 0.1, LOW), 2: spot(0.6, 0.0, FLAT)}
    goals = [Goal("a" if matters else "c", on="table", relation="anywhere")]
    drawn = world([LOW, LOW, FLAT], goals)
    blind = tuple(dataclasses.replace(actor, pose=(math.nan,) * 7) for actor in drawn.objects)
    post = CameraPostProcess(load_robot("panda"), PERFECT, ["scene"])
    post.reset(dataclasses.replace(drawn, objects=blind), drawn.world_model(["left", "right"], 0.08))
    joints, tips = np.zeros(len(load_robot("panda").joints)), np.zeros((2, 3))
    state = WorldState(0.0, joints, joints, joints, tips, np.zeros(6), AWAY, tips)
    if not matters:
        seen = post.observe(state, {"scene": picture(drawn, where)})
        assert np.isfinite(seen.objects).all() and not post.unseen()
        return
    with pytest.raises(NotToldApartError, match="'a' and 'b' cannot be told apart") as error:
        post.observe(state, {"scene": picture(drawn, where)})
    assert "'c'" not in str(error.value) and "colours" in str(error.value)
