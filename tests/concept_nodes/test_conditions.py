"""Conditions: each world as alone, right at their limits, and they say what they saw."""

import math

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.concept.condition import HOLDS, HOLDS_NOT
from bt_tasksim.concept_nodes import AtPose, Holding, Pick, Place, TimePassed, Upright
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError


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
