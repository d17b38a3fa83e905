"""Place: each world as alone, down until the support is felt, and what it says when it cannot."""

import dataclasses

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.concept_nodes import Place
from bt_tasksim.concept_nodes.holding import NOT_HELD
from bt_tasksim.core.outcomes import CANNOT_START, DONE


@pytest.mark.parametrize("scenario", ["pick_and_place", "shelf_to_shelf"])
def test_each_world_is_treated_as_alone(situations, functions, scenario):
    answers = {name: situations(Place, scenario).check(name) for name in functions}
    for name in ("done", "maintained", "necessary_cost", "sufficient_cost"):
        assert len({float(np.squeeze(a)) for a in answers[name]}) > 1, name


def held(toy, leaf):
    stage = toy(leaf)
    stage.world.hold("cup")
    stage.look()
    return stage


def heights(stage):
    return np.array([c.tool[2] for c in stage.world.steps])


def follow(stage, floor=None, newtons=8.0):
    """The cup follows the tool, and pushes back where it meets a floor at this height of its centre."""
    step = stage.world.step

    def moved(command):
        before = stage.world.now.tool_pose.copy()
        step(command)
        now = stage.world.now
        objects = now.objects.copy()
        objects[0, :3] += now.tool_pose[:3] - before[:3]
        wrench = np.zeros(6)
        if floor is not None and objects[0, 2] < floor:
            wrench[2] = -newtons  # in the tool's frame, whose z points down
        stage.world.now = dataclasses.replace(now, objects=objects, wrench=wrench)
        return stage.world.now

    stage.world.step = moved


def test_it_stops_when_the_support_is_felt(toy):
    leaf = Place("cup", on="goal")
    stage = held(toy, leaf)
    follow(stage, floor=0.2)
    assert stage.tick(400) == Status.SUCCESS
    assert heights(stage)[-1] == pytest.approx(0.2, abs=0.03) and heights(stage)[-1] > 0.15
    assert leaf.outcome.is_a(DONE) and leaf.outcome.detail.numbers["felt"] == pytest.approx(8.0)


def test_less_than_the_pressing_force_is_no_support(toy):
    leaf = Place("cup", on="goal", press=10.0)
    stage = held(toy, leaf)
    follow(stage, floor=0.2)
    assert stage.tick(400) == Status.SUCCESS and heights(stage)[-1] < 0.1


def test_it_ends_a_little_below_where_the_support_should_be(toy):
    leaf = Place("cup", on="goal", overshoot=0.007, speed=0.12)
    stage = held(toy, leaf)
    follow(stage)
    assert stage.tick(400) == Status.SUCCESS
    model = stage.world.model
    half = model.object("cup").extent[2] / 2
    assert heights(stage)[-1] == pytest.approx(model.place("goal").pose[2] + half - 0.007, abs=1e-3)
    assert np.abs(np.diff([c.tool[:3] for c in stage.world.steps], axis=0)).max() / 0.05 < 0.12 * 1.05


def test_a_distance_limits_how_far_it_goes(toy):
    leaf = Place("cup", on="goal", distance=0.05, overshoot=0.0)
    stage = held(toy, leaf)
    start = stage.world.now.tool_pose[2]
    follow(stage)
    assert stage.tick(400) == Status.SUCCESS
    assert heights(stage)[-1] == pytest.approx(start - 0.05, abs=1e-3)


def test_without_the_object_in_the_hand_it_cannot_start(toy):
    stage = toy(Place("cup", on="goal"))
    assert stage.tick() == Status.FAILURE
    assert stage.tree.outcome.is_a(CANNOT_START) and stage.tree.outcome.is_a(NOT_HELD)


def test_the_cost_falls_to_nothing_where_it_stands(recorded_run):
    decisions = [d for d in recorded_run("pick_and_place") if type(d.leaf.model) is Place]
    cost = [float(d.leaf.model.necessary_cost(d.seen, d.memory)[0]) for d in decisions]
    assert cost[0] > 0.04 and cost[-1] < 0.012
