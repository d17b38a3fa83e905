"""Conditions: each world as alone, right at their limits, and they say what they saw."""

import math

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.concept.condition import HOLDS, HOLDS_NOT
from bt_tasksim.concept_nodes import (
    AtPose,
    Beside,
    Clear,
    HandEmpty,
    Holding,
    InContact,
    Inside,
    Lifted,
    Over,
    Pick,
    Place,
    StandsOn,
    TimePassed,
    Upright,
)
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.execution.runner import Runner
from bt_tasksim.trees.load import load_source


@pytest.mark.parametrize("scenario", ["pick_and_place", "shelf_to_shelf"])
def test_each_world_is_treated_as_alone(situations, scenario):
    near = situations(Place, scenario)
    target, place = near.model.target, near.model.on
    for condition in (
        Holding.value(target),
        AtPose.value(target, on=place, tolerance=0.05, angle=0.3),
        AtPose.value(target, on=target, tolerance=0.1, angle=3.2),
        Upright.value(target),
        TimePassed.value(3.0),
    ):
        answers = situations(Pick if isinstance(condition, TimePassed) else Place, scenario).check(
            "holds", condition
        )
        assert all(answer.shape == (1,) and answer.dtype == bool for answer in answers)


@pytest.mark.parametrize("scenario", ["pick_and_place", "shelf_to_shelf"])
def test_the_situations_of_that_test_have_both_answers(situations, scenario):
    near = situations(Place, scenario)
    target, place = near.model.target, near.model.on
    for condition in (
        Holding.value(target),
        AtPose.value(target, on=place, tolerance=0.05, angle=0.3),
        Upright.value(target),
    ):
        answers = {bool(near.ask("holds", s, condition)[0]) for s in near.single}
        assert answers == {True, False}, condition


def asked(toy, condition, **changes):
    stage = toy(condition)
    stage.world.put(**changes)
    stage.look()
    stage.tick()
    return stage.tree


def objects_with(toy, pose):
    stage = toy(TimePassed(0.0))
    objects = stage.world.now.objects.copy()
    objects[0] = pose
    return objects


@pytest.mark.parametrize(("degrees", "yes"), [(0, True), (11, True), (12, False), (90, False)])
def test_upright(toy, degrees, yes):
    tilted = poses.pose([0.5, 0, 0.1], poses.from_rotation_vector(np.array([0, math.radians(degrees), 0])))
    found = asked(toy, Upright("cup"), objects=objects_with(toy, tilted))
    assert found.status == (Status.SUCCESS if yes else Status.FAILURE)
    assert found.outcome.detail.numbers["angle"] == pytest.approx(math.radians(degrees), abs=1e-6)


@pytest.mark.parametrize(
    ("millimetres", "degrees", "yes"),
    [(0, 0, True), (19, 0, True), (21, 0, False), (0, 11, True), (0, 12, False)],
)
def test_at_pose(toy, millimetres, degrees, yes):
    world = toy(TimePassed(0.0)).world.model
    place, half = world.place("goal"), world.object("cup").extent[2] / 2
    turn = poses.from_rotation_vector(np.array([0, math.radians(degrees), 0]))
    pose = poses.multiply(place.pose, poses.pose([millimetres / 1000, 0, half], turn))
    found = asked(toy, AtPose("cup", on="goal"), objects=objects_with(toy, pose))
    assert found.status == (Status.SUCCESS if yes else Status.FAILURE)
    off = {"distance": millimetres / 1000, "angle": math.radians(degrees)}
    assert found.outcome.detail.numbers == pytest.approx(off, abs=1e-6)


def test_on_another_object(toy):
    world = toy(TimePassed(0.0)).world.model
    box = toy(TimePassed(0.0)).world.now.objects[1]
    above = box + np.array(
        [0, 0, (world.object("box").extent[2] + world.object("cup").extent[2]) / 2, 0, 0, 0, 0]
    )
    assert asked(toy, AtPose("cup", on="box"), objects=objects_with(toy, above)).status == Status.SUCCESS
    assert asked(toy, AtPose("cup", on="box")).status == Status.FAILURE


@pytest.mark.parametrize(
    ("axis", "degrees", "yes"), [((0, 0, 1), 50, True), ((0, 1, 0), 11, True), ((0, 1, 0), 12, False)]
)
def test_on_another_object_it_may_be_turned_anyhow_and_not_tilted(toy, axis, degrees, yes):
    world = toy(TimePassed(0.0)).world
    cup, height = world.now.objects[0], world.model.object("box").extent[2]
    turn = poses.from_rotation_vector(math.radians(degrees) * np.array(axis, float))
    up = np.array([*cup[:2], cup[2] + (world.model.object("cup").extent[2] + height) / 2])
    objects = np.stack([cup, np.concatenate([up, poses.quat_multiply(cup[3:], turn)])])
    found = asked(toy, AtPose("box", on="cup"), objects=objects)
    assert found.status == (Status.SUCCESS if yes else Status.FAILURE)


@pytest.mark.parametrize(("time", "yes"), [(1.95, False), (2.0, True)])
def test_time_passed(toy, time, yes):
    found = asked(toy, TimePassed(2.0), time=np.float64(time))
    assert found.status == (Status.SUCCESS if yes else Status.FAILURE)
    assert found.outcome.is_a(HOLDS if yes else HOLDS_NOT)
    assert found.outcome.detail.numbers == {"time": time}


def test_holding(toy):
    stage = toy(Holding("cup"))
    assert stage.tick() == Status.FAILURE and stage.tree.outcome.detail.numbers["distance"] > 0.03
    stage.world.hold("cup")
    stage.look()
    assert stage.tick() == Status.SUCCESS and stage.tree.outcome.detail.numbers["distance"] < 0.03


def test_conditions_command_nothing_and_are_built_again(toy):
    stage = toy(Holding("cup"))
    stage.tick()
    assert stage.context.command.tool is None and stage.context.command.hand is None
    leaf = AtPose("cup", on="goal", tolerance=0.01, name="there")
    assert AtPose(**leaf.arguments()).model == leaf.model and leaf.arguments()["name"] == "there"
    with pytest.raises(InputError, match="condition AtPose: parameter 'on' is missing"):
        AtPose("cup")


# ---- of the hand -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "yes"),
    [
        ({}, True),
        ({"closure": np.float64(0.14)}, True),
        ({"closure": np.float64(0.16)}, False),
        ({"contacts": np.array([True, False])}, False),
    ],
)
def test_hand_empty(toy, changes, yes):
    found = asked(toy, HandEmpty(), **changes)
    assert found.status == (Status.SUCCESS if yes else Status.FAILURE)


@pytest.mark.parametrize(("millimetres", "yes"), [(29, False), (31, True)])
def test_a_hand_beside_an_object_is_not_clear(toy, millimetres, yes):
    stage = toy(HandEmpty())
    tool, half = stage.world.now.tool_pose.copy(), stage.world.model.object("cup").extent[2] / 2
    cup = np.array([*tool[:3], 1.0, 0.0, 0.0, 0.0])
    cup[2] -= half + millimetres / 1000
    found = asked(toy, HandEmpty(), objects=objects_with(toy, cup))
    assert found.status == (Status.SUCCESS if yes else Status.FAILURE)
    assert found.outcome.detail.numbers["distance"] == pytest.approx(millimetres / 1000)
    unseen = asked(toy, HandEmpty(), objects=np.full_like(stage.world.now.objects, np.nan))
    assert unseen.status == Status.SUCCESS


def held(toy, condition, position):
    """Ask with the cup upright in the hand, its lowest point at a position."""
    stage = toy(condition)
    world = stage.world
    cup = np.array([*position, 1.0, 0.0, 0.0, 0.0])
    cup[2] += world.model.object("cup").extent[2] / 2
    tool = world.now.tool_pose.copy()
    tool[:3] = cup[:3]
    world.put(tool_pose=tool)
    world.hold("cup")
    objects = world.now.objects.copy()
    objects[0] = cup
    world.put(objects=objects)
    stage.look()
    stage.tick()
    return stage.tree


@pytest.mark.parametrize("above", [None, "table"])
@pytest.mark.parametrize(("millimetres", "yes"), [(79, False), (81, True), (200, True)])
def test_lifted(toy, above, millimetres, yes):
    table = toy(TimePassed(0.0)).world.model.place("table").pose
    found = held(toy, Lifted("cup", above=above, height=0.1), [0.5, 0.0, table[2] + millimetres / 1000])
    assert found.status == (Status.SUCCESS if yes else Status.FAILURE)
    assert found.outcome.detail.numbers["height"] == pytest.approx(millimetres / 1000)
    assert asked(toy, Lifted("cup", height=0.0)).status == Status.FAILURE  # it only stands


@pytest.mark.parametrize(
    ("aside", "up", "yes"), [(0.0, 0.1, True), (0.029, 0.1, True), (0.031, 0.1, False), (0.0, -0.01, False)]
)
def test_over(toy, aside, up, yes):
    goal = toy(TimePassed(0.0)).world.model.place("goal").pose
    found = held(toy, Over("cup", "goal"), goal[:3] + np.array([aside, 0.0, up]))
    assert found.status == (Status.SUCCESS if yes else Status.FAILURE)
    assert found.outcome.detail.numbers == pytest.approx({"aside": aside, "height": up}, abs=1e-6)


# ---- of how things stand -----------------------------------------------------------------------------------


def standing(toy, condition, place, aside=(0.0, 0.0), up=0.0, other=(0.5, 0.05)):
    """Ask with the cup upright on a place's surface, and the box on the table."""
    world = toy(condition).world
    cup = np.array([*world.model.place(place).pose[:3], 1.0, 0.0, 0.0, 0.0])
    cup[:3] += [*aside, up + world.model.object("cup").extent[2] / 2]
    box = np.array([*other, world.model.object("box").extent[2] / 2, 1.0, 0.0, 0.0, 0.0])
    box[2] += world.model.place("table").pose[2]
    return asked(toy, condition, objects=np.array([cup, box]))


@pytest.mark.parametrize(
    ("aside", "up", "yes"),
    [
        ((0.0, 0.0), 0.0, True),
        ((0.059, 0.0), 0.0, True),
        ((0.061, 0.0), 0.0, False),
        ((0.0, 0.0), 0.03, False),
    ],
)
def test_on_a_place(toy, aside, up, yes):
    assert toy(TimePassed(0.0)).world.model.place("goal").extent == (0.12, 0.12)
    found = standing(toy, StandsOn("cup", "goal"), "goal", aside, up)
    assert found.status == (Status.SUCCESS if yes else Status.FAILURE)


def test_on_an_object(toy):
    world = toy(TimePassed(0.0)).world
    box, half = world.now.objects[1].copy(), world.model.object("cup").extent[2] / 2
    box[2] += world.model.object("box").extent[2] / 2 + half
    assert asked(toy, StandsOn("cup", "box"), objects=objects_with(toy, box)).status == Status.SUCCESS
    assert asked(toy, Clear("box"), objects=objects_with(toy, box)).status == Status.FAILURE
    assert asked(toy, StandsOn("cup", "box")).status == Status.FAILURE
    assert asked(toy, Clear("box")).status == Status.SUCCESS


@pytest.mark.parametrize(("gap", "yes"), [(0.01, True), (0.09, True), (0.11, False)])
def test_beside(toy, gap, yes):
    world = toy(TimePassed(0.0)).world.model
    apart = gap + world.object("cup").extent[0] / 2 + world.object("box").extent[0] / 2
    goal = world.place("goal").pose
    found = standing(toy, Beside("cup", "box"), "goal", other=(goal[0] + apart, goal[1]))
    assert found.status == (Status.SUCCESS if yes else Status.FAILURE)
    assert found.outcome.detail.numbers["gap"] == pytest.approx(gap, abs=1e-6)
    higher = standing(toy, Beside("cup", "box"), "goal", other=(goal[0] + apart, goal[1]), up=0.03)
    assert higher.status == Status.FAILURE


@pytest.mark.parametrize(("gap", "yes"), [(0.0, True), (0.005, True), (0.007, False), (0.1, False)])
def test_in_contact(toy, gap, yes):
    world = toy(TimePassed(0.0)).world.model
    apart = gap + world.object("cup").extent[0] / 2 + world.object("box").extent[0] / 2
    goal = world.place("goal").pose
    for one, other in (("cup", "box"), ("box", "cup")):
        found = standing(toy, InContact(one, other), "goal", other=(goal[0] + apart, goal[1]))
        assert found.status == (Status.SUCCESS if yes else Status.FAILURE)
        assert found.outcome.detail.numbers["gap"] == pytest.approx(gap, abs=1e-6)
    lifted = standing(toy, InContact("cup", "table"), "goal", up=gap)
    assert lifted.status == (Status.SUCCESS if yes else Status.FAILURE)


@pytest.mark.parametrize(("gap", "yes"), [(-0.005, False), (0.005, True)])
def test_there_is_room_for_the_target(toy, gap, yes):
    world = toy(TimePassed(0.0)).world.model
    apart = gap + world.object("cup").extent[0] / 2 + world.object("box").extent[0] / 2
    goal = world.place("goal").pose
    other = (goal[0] + apart, goal[1])
    found = standing(toy, Clear("goal", "cup"), "table", aside=(-0.1, -0.3), other=other)
    assert found.status == (Status.SUCCESS if yes else Status.FAILURE)
    assert found.outcome.sentence == ("goal is free" if yes else "goal is taken by box")
    itself = standing(toy, Clear("goal", "cup"), "goal")
    assert itself.status == Status.SUCCESS
    assert standing(toy, Clear("goal"), "goal").status == Status.FAILURE


@pytest.mark.parametrize(
    ("where", "yes"),
    [
        ((0.0, 0.0, 0.05), True),
        ((0.0, 0.0, 0.4), False),
        ((0.3, 0.0, 0.05), False),
        ((0.0, 0.0, -0.02), False),
    ],
)
def test_inside(toy, where, yes):
    scene = load_source("pick_and_throw").scene
    stage = toy(Inside("cup", "trash_bin"), scene)
    bin_ = stage.world.model.place("trash_bin")
    assert bin_.height < 0.4 and bin_.extent[0] < 0.6
    pose = np.concatenate([poses.transform(bin_.pose, np.array(where)), [1.0, 0.0, 0.0, 0.0]])
    stage.world.put(objects=pose[None])
    stage.look()
    assert stage.tick() == (Status.SUCCESS if yes else Status.FAILURE)


@pytest.mark.physical
def test_conditions_of_a_real_run_change_when_they_should():
    """In a run of pick and place: on the table, then lifted, then over the goal, then on it."""
    source = load_source("pick_and_place")
    conditions = {
        "room": Clear.value("goal", "target"),
        "on": StandsOn.value("target", "goal"),
        "lifted": Lifted.value("target"),
        "over": Over.value("target", "goal"),
        "empty": HandEmpty.value(),
    }
    runner, first = Runner(source.build(), source.scene), {}

    def watch(step):
        seen = runner.context.seen(np.array([0]), np.zeros(1))
        for name, condition in conditions.items():
            first.setdefault(name, []).append(bool(condition.holds(seen)[0]))

    for seed in range(7, 10):
        first.clear()
        if runner.run(seed, record=watch).success:
            break
    assert all(first["room"])
    assert not first["on"][0] and first["on"][-1]
    begins = {name: found.index(True) for name, found in first.items()}
    assert 0 == begins["empty"] < begins["lifted"] < begins["over"] < begins["on"]
    assert not first["lifted"][-1] and not first["over"][-1] and first["empty"][-1]
