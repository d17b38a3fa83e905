"""Why a tree failed in one world of a batch; that it is what py_trees' nodes say is shown on random trees."""

from __future__ import annotations

import numpy as np
import pytest
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Running
from py_trees.common import Status
from py_trees.composites import Sequence
from py_trees.decorators import Decorator, Inverter

from bt_tasksim import trees
from bt_tasksim.concept.reporting import speaker, whole_outcome
from bt_tasksim.core.batch_leaf import FAILURE, RUNNING, SUCCESS, BatchLeaf
from bt_tasksim.core.outcomes import FAILED, TIMED_OUT
from bt_tasksim.execution.batch import BatchTree
from bt_tasksim.trees.nodes.fallback import ALTERNATIVES_FAILED
from bt_tasksim.trees.nodes.retry import ATTEMPT_FAILED
from bt_tasksim.trees.nodes.timeout import AT_WORK


class Fails(BatchLeaf):
    """Fails in odd worlds, in its second tick, and runs on in others."""

    def __init__(self):
        self.times, self.failed = np.zeros(4, int), np.zeros(4, bool)

    def tick(self, rows, fresh):
        status = np.where((rows % 2 == 1) & ~fresh, np.int8(FAILURE), np.int8(RUNNING))
        self.failed[rows] = status == FAILURE
        self.times[rows] += self.failed[rows]
        return status

    def outcome(self, row):
        return FAILED(text=f"time {self.times[row]} in world {row}") if self.failed[row] else None


class Nods(BatchLeaf):
    def tick(self, rows, fresh):
        return np.full(len(rows), SUCCESS, np.int8)


def test_a_failure_is_told_with_what_was_tried_before_by_world():
    tree = trees.sequence("root", Running("first"), trees.timeout(1.0, trees.retry(2, Running("second"))))
    batch = BatchTree(tree, 4, lambda leaf: Nods() if leaf.name == "first" else Fails())
    everyone = np.arange(4)
    for now in (0.0, 0.1, 0.2):
        found = batch.tick(everyone, now)
    assert found.tolist() == [RUNNING, FAILURE, RUNNING, FAILURE]
    for world in (1, 3):
        assert batch.speaker(world) is batch.nodes[4]
        outcome = batch.outcome(world)
        assert outcome.is_a(ATTEMPT_FAILED) and outcome.cause == FAILED(text=f"time 2 in world {world}")
        assert f"time 1 in world {world}" in outcome.names["before"]
    batch.tick(np.asarray([0, 2]), 1.0)
    assert batch.outcome(0).is_a(TIMED_OUT) and batch.speaker(0) is batch.nodes[2]
    batch.reset(everyone)
    batch.tick(everyone, 0.0)
    batch.tick(everyone, 2.0)
    late = TIMED_OUT(AT_WORK(None, node="second"), limit=1.0)
    assert batch.outcome(1) == late, "what was before the world began anew is forgotten"


def test_a_fallback_tells_by_world_why_the_first_way_failed_too():
    tree = trees.fallback("root", Running("first"), Running("second"))
    batch = BatchTree(tree, 4, lambda leaf: Fails())
    everyone = np.arange(4)
    for now in (0.0, 0.1, 0.2):
        found = batch.tick(everyone, now)
    assert found.tolist() == [RUNNING, FAILURE, RUNNING, FAILURE]
    for world in (1, 3):
        outcome = batch.outcome(world)
        assert outcome.is_a(ALTERNATIVES_FAILED) and outcome.cause == FAILED(text=f"time 1 in world {world}")
        assert outcome.names["before"] == f"first: time 1 in world {world}"
    batch.tick(everyone, 0.3)
    batch.tick(everyone, 0.4)
    batch.tick(everyone, 0.5)
    assert batch.outcome(1).names["before"] == "first: time 2 in world 1", "and it counts anew"


class Says(Behaviour):
    """A behaviour of somebody's own, which fails or succeeds in its second tick, and says so."""

    def __init__(self, name, fails=True):
        super().__init__(name)
        self.fails, self.ticks = fails, 0

    def update(self):
        self.ticks += 1
        self.feedback_message = f"{self.name} in tick {self.ticks}"
        if self.ticks % 2:
            return Status.RUNNING
        return Status.FAILURE if self.fails else Status.SUCCESS


class Own(Decorator):
    """A decorator of somebody's own: all below it is ticked by py_trees."""

    def update(self):
        return self.decorated.status


class OwnSequence(Sequence):
    """A composite of somebody's own."""


@pytest.mark.parametrize(
    "build",
    [
        lambda: trees.sequence("root", Own("own", Says("culprit"))),
        lambda: Own("own", trees.sequence("inner", Says("fine", fails=False), Says("culprit"))),
        lambda: trees.retry(2, Own("own", trees.retry(2, Says("culprit")))),
        lambda: Own("own", trees.fallback("first or second", Own("o", Says("first")), Says("second"))),
        lambda: trees.sequence("root", Own("own", Inverter("not", Says("fine", fails=False)))),
        lambda: trees.fallback("root", OwnSequence("own", True, [Says("culprit")]), Own("o", Says("last"))),
    ],
)
def test_below_what_is_not_known_it_is_said_as_py_trees_says_it(build):
    tree, batch = build(), BatchTree(build(), 2, lambda leaf: None, build=build)
    everyone = np.arange(2)
    for now in range(12):
        batch.tick(everyone, float(now))
        tree.tick_once()
        if tree.status != Status.RUNNING:
            break
    assert tree.status == Status.FAILURE
    for world in (0, 1):
        assert batch.speaker(world).name == speaker(tree).name
        assert batch.outcome(world) == whole_outcome(speaker(tree))
