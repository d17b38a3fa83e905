"""A palm that may meet the top of what it takes comes slowly, and lands once."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.concept_nodes.grasp_features import ALONG, CAREFUL, EAGER, HASTE, SCALE, TIME_SCALING
from bt_tasksim.concept_nodes.grasp_landing import (
    FELT,
    LIFTED,
    SLOWEST,
    SPEED,
    ZONE,
    landing,
    reaches_palm,
)
from bt_tasksim.execution.batch_runner import BatchRunner
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.trees.load import load_source

PRESSED = (670001, 670007, 670010, 670016)
"""Draws whose objects are taller than believed: with MuJoCo the palm pressed 60 to 74 N in each."""


@pytest.fixture
def near(situations):
    return situations(Grasp, "shelf_to_shelf")


def coming(near, push=0.0, before=0.5 * ZONE):
    """A hand ``before`` its grasp in metres, pushed with so many newtons, that has not begun to close."""
    at = near.asked(near.single[0])
    seen, memory = at.seen, at.memory
    tool = memory.goal.copy()
    tool[:, 2] += before
    wrench = np.array([[0.0, 0.0, -push, 0.0, 0.0, 0.0]])
    observation = dataclasses.replace(
        seen.observation, tool_pose=tool, wrench=wrench, contacts=np.zeros_like(seen.contacts)
    )
    elapsed = memory.begins + 0.4 * (memory.path.duration - memory.begins)
    memory = memory._replace(
        lands=np.array([True]),
        tight=np.array([False]),
        closing=np.array([-1.0]),
        delay=np.zeros(1),
        offset=memory.middle * np.array(SCALE),
    )
    return Seen(observation, seen.world, seen.robot, elapsed, seen.later, seen.failures), memory


def share(pace):
    return CAREFUL + EAGER * float(pace[0])


@pytest.mark.parametrize(
    ("what", "changes"),
    [
        ("far above", {}),
        ("clear of it", {"lands": np.array([False])}),
        ("closing", {"closing": np.array([0.1])}),
    ],
)
def test_elsewhere_the_hand_comes_as_usual(near, what, changes):
    seen, memory = coming(near, push=10.0, before=2 * ZONE if what == "far above" else 0.5 * ZONE)
    memory = memory._replace(**changes)
    assert not landing(seen, memory).near[0]
    action = near.model.programmed_motion(seen, memory)
    assert action[0, TIME_SCALING] == HASTE and action[0, ALONG] == 0.0


def test_it_comes_slowly(near):
    seen, memory = coming(near)
    found = landing(seen, memory)
    goes = float(found.goes[0])
    assert goes > SPEED * seen.world.control_period, "its own speed is higher"
    assert found.near[0] and found.back[0] == 0.0
    assert SLOWEST <= share(found.pace) <= SPEED * seen.world.control_period / goes + 1e-9
    assert near.model.programmed_motion(seen, memory)[0, TIME_SCALING] == found.pace[0]


def test_where_it_presses_it_is_lifted_and_the_motion_waits(near):
    seen, memory = coming(near, push=FELT + 0.1)
    found = landing(seen, memory)
    assert share(found.pace) == pytest.approx(0.0) and found.back[0] == LIFTED


def test_once_landed_it_goes_no_farther(near):
    seen, memory = coming(near)
    memory = memory._replace(offset=memory.offset - LIFTED * np.eye(5)[ALONG])
    found = landing(seen, memory)
    goes = float(found.goes[0])
    assert share(found.pace) * goes == pytest.approx(found.back[0], rel=1e-6) and found.back[0] > 0.0


def test_what_reaches_nearly_as_far_as_the_hand_is_deep_may_meet_its_palm():
    assert reaches_palm(np.array([0.02, 0.031, 0.033, 0.06]), 0.035).tolist() == [False, False, True, True]


def test_objects_that_are_taller_than_believed_are_taken():
    source = load_source("grasp_then_pick")
    with BatchRunner(source.build, source.scene, EngineOptions(engines="mujoco"), len(PRESSED)) as runner:
        results = [result for _, result in runner.run(PRESSED)]
    taken = [result.success for result in results]
    assert sum(taken) >= len(PRESSED) - 1, results
