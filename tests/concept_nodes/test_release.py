"""Release: each world as alone, opens before it draws back, and ends what was held."""

import dataclasses
import sys

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Release, retreat
from bt_tasksim.concept_nodes.release import _opened
from bt_tasksim.concept_nodes.view import views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.outcomes import TIMED_OUT
from bt_tasksim.core.world import Obstacle
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.kinematics.hand import SLIDE
from bt_tasksim.scene.spatial_laws import Hollow, PlacedObject, beyond_hollow


@pytest.mark.parametrize("scenario", ["pick_and_place", "pick_and_throw"])
def test_each_world_is_treated_as_alone(situations, functions, scenario):
    for name in functions:
        if name != "maintained":  # it maintains nothing
            situations(Release, scenario).check(name)


def start(toy, leaf):
    stage = toy(leaf)
    stage.world.hold("cup")
    stage.look()
    stage.context.reach("holding", "cup", ONE)
    step = stage.world.step

    def let_go(command):
        step(command)
        stage.world.put(contacts=np.full(2, bool(stage.world.now.closure > 0.3)))
        return stage.world.now

    stage.world.step = let_go
    return stage


def test_it_opens_then_draws_back_against_its_approach(toy):
    leaf = Release("cup", retreat=0.12, opening=0.4)
    stage = start(toy, leaf)
    first = stage.world.now.tool_pose.copy()
    assert stage.tick(200) == Status.SUCCESS
    tools = np.array([c.tool for c in stage.world.steps])
    hands = np.array([c.hand[0] for c in stage.world.steps])
    assert hands[0] == pytest.approx(1.0), "it lets go of its pressure first: there is no step to where it is"
    assert np.all(np.diff(hands) <= 1e-12) and hands[-1] == 0.0
    moved = np.linalg.norm(tools[:, :3] - first[:3], axis=-1)
    assert np.all(moved[hands > 0.01] < 1e-9), "it draws back only when it is open"
    back = -poses.rotate(first[3:], np.array([0.0, 0, 1]))
    assert np.allclose(tools[-1][:3] - first[:3], 0.12 * back, atol=1e-3)


def test_fingers_that_something_stops_as_they_open_are_drawn_back_from_it(toy):
    stage = start(toy, Release("cup"))
    first, step = stage.world.now.tool_pose.copy(), stage.world.step

    def stopped(command):
        step(command)
        if np.linalg.norm(stage.world.now.tool_pose[:3] - first[:3]) < 0.01:
            closure = max(float(stage.world.now.closure), 0.43)
            stage.world.put(closure=np.array(closure), contacts=np.ones(2, bool))
        return stage.world.now

    stage.world.step = stopped
    assert stage.tick(160) == Status.SUCCESS


@pytest.mark.parametrize(("closure", "at_once"), [(0.3, True), (0.45, False)])
def test_fingers_that_press_on_something_once_they_have_parted_are_drawn_back_at_once(toy, closure, at_once):
    stage = start(toy, Release("cup", opening=0.4))
    first, step = stage.world.now.tool_pose.copy(), stage.world.step
    began = []

    def pressing(command):
        step(command)
        if np.linalg.norm(stage.world.now.tool_pose[:3] - first[:3]) < 0.01:
            stopped = max(float(stage.world.now.closure), closure)
            stage.world.put(closure=np.array(stopped), wrench=np.array([0.0, 0, 50.0, 0, 0, 0]))
        else:
            began.append(stage.context.now)
            stage.world.put(wrench=np.zeros(6))
        return stage.world.now

    stage.world.step = pressing
    assert stage.tick(160) == Status.SUCCESS
    assert (began[0] < 1.0) == at_once


def test_afterwards_nothing_is_held(toy):
    stage = start(toy, Release("cup"))
    stage.tick(200)
    assert not stage.context.reached("holding", "cup", ONE)


def test_a_hand_that_still_touches_something_is_not_done(toy):
    leaf = Release("cup", timeout=4)
    stage = start(toy, leaf)
    step = stage.world.step

    def stuck(command):
        step(command)
        stage.world.put(contacts=np.array([True, False]))
        return stage.world.now

    stage.world.step = stuck
    assert stage.tick(200) == Status.FAILURE
    assert leaf.outcome.is_a(TIMED_OUT)
    assert leaf.outcome.detail.numbers == pytest.approx({"opening": 1.0, "contacts": 1, "force": 0.0})
    assert stage.context.reached("holding", "cup", ONE)


def test_a_finger_that_stands_still_goes_aside_before_the_hand_draws_back(toy, monkeypatch):
    module = sys.modules[Release.__module__]
    monkeypatch.setattr(retreat, "standing_side", lambda robot: -0.007)
    monkeypatch.setattr(module, "_opened", lambda view, target: view.robot.hand_open)
    stage = start(toy, Release("cup", retreat=0.12, opening=0.4))
    first = stage.world.now.tool_pose.copy()
    assert stage.tick(300) == Status.SUCCESS
    gone = poses.localise(first, np.array([command.tool[:3] for command in stage.world.steps]))
    assert gone[-1] == pytest.approx([0.0, -SLIDE, -0.12], abs=2e-3)
    aside = gone[np.abs(gone[:, 2]) < 1e-3]
    assert aside[:, 1].min() == pytest.approx(-SLIDE, abs=1e-3), "it goes aside first"


def test_a_finger_that_stands_still_leaves_what_it_let_go_even_where_the_hand_cannot_draw_back(
    toy, monkeypatch
):
    def nowhere(*_):
        raise NoWayError("there is no room")

    module = sys.modules[Release.__module__]
    monkeypatch.setattr(retreat, "standing_side", lambda robot: -0.007)
    monkeypatch.setattr(module, "_opened", lambda view, target: view.robot.hand_open)
    for place in (module, retreat):
        monkeypatch.setattr(place, "clear_retreat", nowhere)
    stage = start(toy, Release("cup", retreat=0.12, opening=0.4))
    first = stage.world.now.tool_pose.copy()
    assert stage.tick(300) == Status.SUCCESS
    gone = poses.localise(first, stage.world.now.tool_pose[:3])
    assert gone == pytest.approx([0.0, -SLIDE, 0.0], abs=1e-3)


def test_a_hand_with_little_room_draws_back_a_little(toy, monkeypatch):
    straight = retreat.WayFinder.straight

    def short(finder, way, *rest, **more):
        far = np.linalg.norm(way[-1][:3] - way[0][:3])
        return straight(finder, way, *rest, **more) if far < 0.2 * 0.12 else None

    monkeypatch.setattr(retreat.WayFinder, "straight", short)
    stage = start(toy, Release("cup", retreat=0.12, opening=0.4))
    first = stage.world.now.tool_pose.copy()
    assert stage.tick(300) == Status.SUCCESS
    assert poses.localise(first, stage.world.now.tool_pose[:3])[2] == pytest.approx(-0.012, abs=1e-3)


@pytest.mark.parametrize(("below", "inside"), [(0.001, False), (0.004, True), (-0.001, False)])
def test_what_leans_just_below_a_rim_is_not_surely_in_there(below, inside):
    """A stick of 6 cm, 2 cm off the floor of a bin 5 cm deep: estimates may be wrong by 2 mm."""
    module = sys.modules[Release.__module__]
    hollow = Hollow(
        poses.pose([0.3, 0.0, 0.0], [1.0, 0, 0, 0])[None], np.array([[[0, 0, 0.1, 0.1, 0.0, 0.05]]])
    )
    middle = poses.pose([0.3, 0.0, 0.05 - below], [1.0, 0, 0, 0])[None]
    corners = np.array([[[0.0, 0.0, -0.03], [0.0, 0.0, 0.03]]])
    stick = PlacedObject(middle, corners, np.zeros(1, bool))
    assert bool(beyond_hollow(stick, module._surely(hollow))[0] <= 0.0) == inside


def test_a_hand_that_presses_on_nothing_opens_from_where_it_is(toy):
    stage = start(toy, Release("cup", opening=0.4))
    stage.world.put(contacts=np.array([True, False]))
    stage.look()
    assert stage.tick(200) == Status.SUCCESS
    assert stage.world.steps[0].hand[0] == pytest.approx(0.5)


def test_where_there_is_little_room_it_draws_back_a_little(toy):
    gone = []
    for height in (0.9, 0.67):
        stage = start(toy, Release("cup", retreat=0.12))
        plate = Obstacle(poses.pose([0.62, 0.0, height]), (0.3, 0.6, 0.02), "plate")
        stage.context.begin([dataclasses.replace(stage.world.model, obstacles=(plate,))])
        stage.look()
        before = stage.world.now.tool_pose[2]
        assert stage.tick(300) == Status.SUCCESS
        gone.append(stage.world.now.tool_pose[2] - before)
    assert gone == pytest.approx([0.12, 0.012], abs=2e-3)


@pytest.mark.parametrize(("beside", "all_the_way"), [(None, True), (0.2, True), (0.07, False)])
def test_a_hand_of_two_fingers_opens_no_wider_than_it_has_room(toy, beside, all_the_way):
    stage = start(toy, Release("cup"))
    tool, model = stage.world.now.tool_pose, stage.world.model
    if beside is not None:
        there = poses.multiply(tool, poses.pose([0.0, beside, 0.0]))
        wall = Obstacle(there, (0.1, 0.02, 0.1), "wall")
        stage.context.begin([dataclasses.replace(model, obstacles=(*model.obstacles, wall))])
        stage.look()
    (view,) = views(stage.context.seen(ONE, np.zeros(1)))
    opened = float(view.robot.closure(_opened(view, "cup")))
    held = float(view.robot.closure(view.hand))
    assert (opened == 0.0) == all_the_way and opened < held


def test_a_hand_of_many_fingers_opens_as_far_as_other_walls_let_it(toy, monkeypatch):
    """Each amount on its way has to be clear: the fingers swing through all of them."""
    module = sys.modules[_opened.__module__]
    stage = start(toy, Release("cup"))
    (view,) = views(stage.context.seen(ONE, np.zeros(1)))
    robot = load_robot("xarm7_ability")
    view = view._replace(robot=robot, hand=robot.hand_position(np.array([0.8])))

    def opened(in_the_way):
        def apart(view, hand, walls):
            return abs(float(robot.closure(hand)) - in_the_way) > 0.05

        monkeypatch.setattr(module, "_apart", apart)
        return float(robot.closure(_opened(view, "cup")))

    monkeypatch.setattr(module, "_other_walls", lambda view, target: ["a spoke"])
    found = [opened(closure) for closure in (-1.0, 0.2, 0.4)]
    assert found == pytest.approx([0.0, 0.4, 0.6], abs=0.02)
    monkeypatch.setattr(module, "_other_walls", lambda view, target: [])
    assert robot.closure(_opened(view, "cup")) == 0.0, "without walls nothing is asked"


@pytest.mark.parametrize(
    ("aside", "gone", "turned", "unseen"),
    [
        (0.0, 0.0, 0.0, True),  # nobody has seen it since
        (0.0, 0.03, 0.0, False),  # it came to rest higher than that, on something that nobody knows
        (0.0, 0.0, 0.5, False),  # it leans there now
        (0.09, 0.0, 0.0, False),  # over a wall of the bin
    ],
)
def test_what_was_let_go_low_in_a_container_and_not_seen_since_counts_as_fallen(
    situations, aside, gone, turned, unseen
):
    """The camera shows it no more, and it is taken for where the hand had it, partly below the rim."""
    near = situations(Release, "pick_and_throw")
    at = near.asked(near.single[-1])
    model, seen = near.model, at.seen
    bin_, size = seen.place("trash_bin"), seen.model(model.target).extent[0]
    column = seen.world.column(model.target)
    above = [aside, 0.0, bin_.height[0] + 0.3 * size[2]]
    held = poses.pose(bin_.pose[0, :3] + above)
    now = poses.multiply(poses.shifted(held, np.array([0, 0, gone])), poses.pose([0.0] * 3, roll(turned)))
    objects = np.array(seen.objects)
    objects[:, column] = now
    memory = at.memory._replace(start_pose=held[None], opened=at.memory.path.duration + 10.0)
    there = seen.believing(objects)
    assert (model._beside(there, memory)[0] == 0.0) == unseen
    assert any(limit.applies[0] for limit in model.limits(there, memory)) != unseen


def roll(angle):
    """A turn about the x axis."""
    return np.array([np.cos(angle / 2), np.sin(angle / 2), 0.0, 0.0])
