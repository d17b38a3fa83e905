"""Planning beside a robot's loop: the arm stands meanwhile, and then all is as if no time had passed."""

import threading

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.concept import activation
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.planner import Planner
from bt_tasksim.core.errors import LeafError, NoWayError
from bt_tasksim.core.outcomes import CANNOT_START, NO_WAY, register_reason
from bt_tasksim.core.world import Command
from bt_tasksim.trees import any_order, sequence


class Ponder(ConceptModel):
    """Plans until it may go on, and is done half a second after it began."""

    actions = 0

    def begin(self, seen):
        self.values_seen.append(float(seen.observation.arm_position[0, 0]))
        assert self.free.wait(20.0)
        if self.error is not None:
            raise self.error
        return seen.tool

    def command(self, action, seen, memory):
        return Command(tool=memory)

    def advance(self, action, seen, memory):
        return memory

    def done(self, seen, memory):
        return seen.elapsed > 0.5

    def limits(self, seen, memory):
        assert memory is not None
        return ()


def pondering(error=None):
    leaf = Ponder()
    leaf.model.free, leaf.model.error, leaf.model.values_seen = threading.Event(), error, []
    return leaf


@pytest.fixture
def robot(toy):
    """A tree on a robot: ``robot(tree)``."""
    planners = []

    def on_robot(tree):
        stage = toy(tree)
        stage.context.planner = Planner()
        planners.append(stage.context.planner)
        return stage

    yield on_robot
    for planner in planners:
        planner.close()


def planned(leaf):
    """Wait until the plan is there."""
    for plan in leaf.activation._plans.values():
        assert plan.ready(20.0)


def test_nothing_is_commanded_while_it_plans_and_its_clock_begins_with_the_plan(robot):
    leaf = pondering()
    stage = robot(leaf)
    for _ in range(4):
        assert stage.tick() == Status.RUNNING and leaf.plans
        assert stage.world.steps[-1].tool is None and "plans" in leaf.feedback_message
    leaf.model.free.set()
    planned(leaf)
    assert stage.tick() == Status.RUNNING and not leaf.plans
    assert stage.world.steps[-1].tool is not None and "plans" not in leaf.feedback_message
    before = stage.context.now
    assert stage.tick(100) == Status.SUCCESS
    assert stage.context.now - before == pytest.approx(0.5, abs=0.11)


def test_in_a_simulation_no_time_passes(toy):
    leaf = pondering()
    leaf.model.free.set()
    stage = toy(leaf)
    assert stage.context.planner is None and stage.tick() == Status.RUNNING
    assert stage.world.steps[0].tool is not None and not leaf.plans


def test_what_was_planned_from_where_the_arm_was_moving_is_planned_anew(robot):
    leaf = pondering()
    stage = robot(leaf)
    stage.tick()
    moved = stage.world.now.arm_position + np.eye(7)[0] * 0.1
    stage.world.put(arm_position=moved)
    stage.world.bend = lambda posture=None: None
    stage.tick()
    leaf.model.free.set()
    planned(leaf)
    stage.tick()  # finds that the arm is elsewhere
    planned(leaf)
    stage.tick()
    assert not leaf.plans and len(leaf.model.values_seen) == 2
    assert leaf.model.values_seen[-1] == pytest.approx(float(moved[0]))


def test_no_way_is_found_out_later_and_others_have_their_turn(robot):
    blocked, other = pondering(NoWayError("a wall is there")), pondering()
    other.model.free.set()
    stage = robot(any_order("both", sequence("first", blocked), sequence("second", other)))
    assert stage.tick() == Status.RUNNING and blocked.plans
    blocked.model.free.set()
    planned(blocked)
    assert stage.tick() == Status.RUNNING  # it has not acted, so the second one has its turn
    assert blocked.status == Status.FAILURE and blocked.outcome.is_a(CANNOT_START)
    assert blocked.outcome.is_a(NO_WAY) and "a wall is there" in blocked.feedback_message
    assert other.status == Status.RUNNING


def test_no_way_from_where_the_arm_was_moving_is_looked_for_anew(robot):
    leaf = pondering(NoWayError("a wall is there"))
    stage = robot(leaf)
    stage.tick()
    stage.world.put(arm_position=stage.world.now.arm_position + np.eye(7)[0] * 0.1)
    stage.world.bend = lambda posture=None: None
    stage.tick()
    leaf.model.free.set()
    planned(leaf)
    leaf.model.error = None  # from here there is one
    assert stage.tick() == Status.RUNNING
    planned(leaf)
    assert stage.tick() == Status.RUNNING and not leaf.plans


def test_an_exception_is_the_leafs_own(robot):
    leaf = pondering(ValueError("too large"))
    stage = robot(leaf)
    leaf.model.free.set()
    with pytest.raises(LeafError, match="too large"):
        stage.tick(3)


def test_a_plan_that_does_not_end_is_waited_for_no_longer_than_so(robot, monkeypatch):
    monkeypatch.setattr(activation, "PATIENCE", 0.2)
    leaf = pondering()
    stage = robot(leaf)
    assert stage.tick(20) == Status.FAILURE and leaf.outcome.is_a(activation.PLANNED_TOO_LONG)
    leaf.model.free.set()


def test_an_interrupted_leaf_waits_for_nothing_any_more_and_may_begin_again(robot):
    leaf = pondering()
    stage = robot(leaf)
    stage.tick()
    leaf.stop(Status.INVALID)
    assert not leaf.plans
    leaf.model.free.set()
    assert stage.tick(4) == Status.RUNNING and leaf.activations == 2


class Hesitate(Ponder):
    """Takes a while to find that it cannot begin."""

    def initial_state(self, seen):
        assert self.free.wait(20.0)
        return NOTHING.where(np.array([True]))


NOTHING = register_reason("hesitates_for_nothing", "there is nothing to be done")


def test_whether_it_can_begin_is_asked_beside_the_loop_too(robot):
    leaf = Hesitate()
    leaf.model.free, leaf.model.error, leaf.model.values_seen = threading.Event(), None, []
    stage = robot(leaf)
    for _ in range(3):
        assert stage.tick() == Status.RUNNING and leaf.plans
    leaf.model.free.set()
    planned(leaf)
    assert stage.tick() == Status.FAILURE
    assert leaf.outcome.is_a(CANNOT_START) and leaf.outcome.is_a(NOTHING)
    assert leaf.model.values_seen == [], "it did not begin"
