"""Pressing what turns against the stop of its hinge."""

import numpy as np
import pytest
from draws import successes
from py_trees.common import Status

from bt_tasksim.concept_nodes import Grasp, HoldTurned, TurnKnob, TurnToStop
from bt_tasksim.concept_nodes.handle import NO_PART, OTHER_PART
from bt_tasksim.concept_nodes.hold_turned import NO_STOP
from bt_tasksim.concept_nodes.holding import NOT_HELD
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.scene import FixtureSpec, Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence
from tests.bt_tasksim.scene.states import drawn, state
from tests.concept_nodes.test_agreement_with_goals import seen_exactly

LEVER = FixtureSpec("lever", parameters={"turns": 1.3, "facing": "up", "spring": 0.6})
CUP = {"cup": ObjectSpec(kinds=("cup",), on="table", centre=(-0.1, -0.25), area=(0.0, 0.0))}


def ran(*leaves, seed=3, goal=1.3, fixture=LEVER):
    goals = [] if goal is None else [Goal("lever", relation="set", value=goal, angle_tolerance=0.06)]
    made = Scene(fixtures=[fixture], objects=CUP, goals=goals, name="lever")
    return Runner(sequence("the tree", *leaves), made, EngineOptions()).run(seed)


@pytest.mark.physical
def test_a_lever_with_a_spring_is_held_on_its_stop():
    def run(seed):
        moved = TurnKnob("lever", angle=1.3), HoldTurned("lever", duration=1.0)
        return ran(Grasp("lever"), *moved, seed=seed)

    (result,) = successes(run, range(3, 6), n=1)
    assert result.status == Status.SUCCESS


@pytest.mark.physical
def test_a_knob_is_held_on_its_stop_by_the_torque_about_its_axis():
    def run(seed):
        fixture = FixtureSpec("knob", parameters={"turns": 2.3, "facing": "up"})
        goal = Goal("knob", relation="set", value=2.3, angle_tolerance=0.06)
        made = Scene(fixtures=[fixture], goal=goal, name="knob")
        tree = sequence("the tree", Grasp("knob"), TurnToStop("knob"), HoldTurned("knob", duration=0.5))
        return Runner(tree, made, EngineOptions()).run(seed)

    (result,) = successes(run, range(3, 6), n=1)
    assert result.status == Status.SUCCESS


def test_it_is_pressed_onto_its_stop_before_that_counts_and_harder_where_it_goes_back():
    configuration, model = drawn(Scene(fixtures=[LEVER]))
    seen = seen_exactly(model, state(configuration))
    seen.observation.wrench = np.zeros((1, 6))
    holds = HoldTurned.value(target="lever")
    memory = holds.begin(seen)
    found = []
    for elapsed, farthest in ((0.0, 0.0), (2.0, 0.0), (2.0, 0.003), (2.0, 0.01)):
        seen.elapsed = np.array([elapsed])
        force, counts = holds.led_to(seen, memory._replace(farthest=np.array([farthest])))
        found.append((float(force[0]), bool(counts[0])))
    assert found == [(18.0, False), (12.0, True), (pytest.approx(16.0), True), (18.0, False)]


@pytest.mark.parametrize(
    ("leaves", "reason"),
    [
        ([HoldTurned("lever")], NOT_HELD),
        ([HoldTurned("cup")], NO_PART),
        ([Grasp("lever"), TurnKnob("lever", angle=0.6), HoldTurned("lever")], NO_STOP),
    ],
)
def test_what_cannot_be_held_on_a_stop_is_refused(leaves, reason):
    result = ran(*leaves, goal=None)
    assert result.status == Status.FAILURE and result.outcome.is_a(reason)


def test_what_slides_is_refused():
    result = ran(HoldTurned("drawer"), fixture=FixtureSpec("chest"), goal=None)
    assert result.status == Status.FAILURE and result.outcome.is_a(OTHER_PART[True])
