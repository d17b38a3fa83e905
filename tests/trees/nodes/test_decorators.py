"""Retry, repeat, time-out, parallel and subtree, tick by tick."""

from __future__ import annotations

import numpy as np
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector

from bt_tasksim import trees
from bt_tasksim.concept.context import Context
from bt_tasksim.concept.reporting import speaker, whole_outcome
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import FAILED, TEXT, TIMED_OUT
from bt_tasksim.trees.nodes.fallback import ALTERNATIVES_FAILED
from bt_tasksim.trees.nodes.parallel import CHILDREN_FAILED
from bt_tasksim.trees.nodes.retry import ATTEMPT_FAILED
from bt_tasksim.trees.nodes.timeout import AT_WORK
from bt_tasksim.trees.vocabulary import kind_of

STATUS = {"R": Status.RUNNING, "S": Status.SUCCESS, "F": Status.FAILURE}
LETTER = {status: letter for letter, status in STATUS.items()}


class Scripted(Behaviour):
    """Answers by a script, over and over, and writes down what happens to it."""

    def __init__(self, script, name="leaf"):
        super().__init__(name)
        self.script, self.log, self.asked = script, "", 0

    def update(self):
        letter = self.script[self.asked % len(self.script)]
        self.asked += 1
        self.log += letter
        self.feedback_message = f"answer {self.asked}"
        return STATUS[letter]

    def terminate(self, new_status):
        if new_status == Status.INVALID and self.status == Status.RUNNING:
            self.log += "x"


def ticks(tree, count):
    out = ""
    for _ in range(count):
        tree.tick_once()
        out += LETTER[tree.status]
    return out


def test_retry_goes_on_in_the_same_tick():
    leaf = Scripted("RFRS")
    assert ticks(trees.retry(3, leaf), 3) == "RRS"
    assert leaf.log == "RFRS"


def test_retry_waits_a_tick_after_a_failure_at_once():
    leaf = Scripted("F")
    tree = trees.retry(3, leaf)
    assert ticks(tree, 3) == "RRF"
    assert leaf.log == "FFF"
    assert tree.outcome.is_a(ATTEMPT_FAILED) and tree.outcome.numbers == {"attempt": 3, "attempts": 3}
    assert tree.outcome.cause == FAILED(text="answer 3"), "what a plain behaviour says is kept"
    assert ticks(tree, 3) == "RRF"


def test_after_the_last_attempt_every_cause_is_said():
    leaf = Scripted("F", "grasp")
    tree = trees.sequence("root", trees.retry(3, leaf))
    assert ticks(tree, 3) == "RRF"
    found = whole_outcome(speaker(tree))
    assert found.is_a(ATTEMPT_FAILED) and found.cause == FAILED(text="answer 3"), "the last one is the reason"
    assert "grasp: answer 1, 2 times" in found.names["before"], "like causes are counted"
    assert found == tree.children[0].outcome

    class Other(Scripted):
        def update(self):
            self.name = f"leaf {self.asked + 1}"
            return super().update()

    tree = trees.retry(3, Other("F"))
    ticks(tree, 3)
    assert all(f"leaf {k}: answer {k}" in tree.outcome.names["before"] for k in (1, 2))


def test_a_fallback_says_why_what_it_tried_first_has_failed():
    ways = Scripted("RF", "first"), Scripted("F", "then"), Scripted("RRF", "last")
    tree = trees.sequence("root", trees.retry(2, trees.fallback("ways", *ways)))
    while tree.status != Status.FAILURE:
        tree.tick_once()
    assert (ways[0].asked, ways[2].asked) == (4, 6), "there were two attempts"
    found = whole_outcome(speaker(tree))
    assert found.is_a(ALTERNATIVES_FAILED) and found.is_a(ATTEMPT_FAILED)
    assert found.cause == FAILED(text="answer 6"), "it is counted by the last one"
    assert "first: answer 4; then: answer 2" in found.sentence, "and those of the last attempt are said"


def test_a_fallback_that_has_not_failed_adds_nothing():
    tree = trees.sequence(
        "root", trees.fallback("f", Scripted("F", "a"), Scripted("S", "b")), Scripted("F", "c")
    )
    ticks(tree, 1)
    assert whole_outcome(speaker(tree)) == FAILED(text="answer 1")


def test_a_fallback_of_one_child_says_no_more_than_it():
    tree = trees.fallback("f", Scripted("F"))
    ticks(tree, 1)
    assert whole_outcome(speaker(tree)) == FAILED(text="answer 1")


def test_py_trees_own_selector_is_a_fallback_too():
    own = Selector("f", memory=True, children=[Scripted("F"), Scripted("S")])
    ours = trees.fallback("f", Scripted("F"), Scripted("S"))
    assert trees.same_tree(own, ours) and kind_of(own).tag == kind_of(ours).tag == "Fallback"
    assert not trees.same_tree(own, trees.reactive_fallback("f", Scripted("F"), Scripted("S")))


def test_one_attempt_says_no_more_than_its_child():
    tree = trees.retry(1, Scripted("F"))
    ticks(tree, 1)
    assert whole_outcome(speaker(tree)) == FAILED(text="answer 1")


def test_retry_without_end():
    assert ticks(trees.retry(-1, Scripted("F")), 50) == "R" * 50


def test_repeat_counts_successes():
    leaf = Scripted("RS")
    assert ticks(trees.repeat(2, leaf), 3) == "RRS"
    assert leaf.log == "RSRS"
    assert ticks(trees.repeat(3, Scripted("SSF")), 3) == "RRF"


def test_an_interrupted_retry_ends_its_child_and_counts_anew():
    leaf = Scripted("RFR")
    tree = trees.retry(2, leaf)
    ticks(tree, 2)
    tree.stop(Status.INVALID)
    assert leaf.log == "RFRx"
    assert leaf.status == Status.INVALID
    tree.tick_once()
    assert tree.rounds == 0


def test_parallel_does_not_tick_finished_children_again():
    first, second = Scripted("S", "first"), Scripted("RRS", "second")
    assert ticks(trees.parallel("p", first, second), 3) == "RRS"
    assert (first.log, second.log) == ("S", "RRS")


def test_parallel_stops_what_still_runs():
    leaves = Scripted("RS", "a"), Scripted("R", "b"), Scripted("R", "c")
    tree = trees.parallel("p", *leaves, success=1)
    assert ticks(tree, 2) == "RS"
    assert [leaf.log for leaf in leaves] == ["RS", "Rx", "Rx"]
    assert all(leaf.status != Status.RUNNING for leaf in leaves)


@pytest.mark.parametrize(
    ("scripts", "success", "failure", "expected"),
    [
        (("S", "F", "R"), -1, 1, "F"),
        (("S", "F", "R"), 1, 1, "S"),
        (("S", "F", "R"), 2, 2, "R"),
        (("F", "F", "R"), 2, -1, "F"),
        (("F", "S", "S"), -2, 2, "S"),
        (("F", "R", "R"), -2, -1, "R"),
        (("F", "F", "F"), 1, -1, "F"),
    ],
)
def test_counts_of_a_parallel(scripts, success, failure, expected):
    tree = trees.parallel("p", *(Scripted(s) for s in scripts), success=success, failure=failure)
    assert ticks(tree, 1) == expected


def test_a_failed_parallel_says_why():
    tree = trees.parallel("p", Scripted("R", "a"), Scripted("F", "b"))
    tree.tick_once()
    assert tree.outcome.is_a(CHILDREN_FAILED) and tree.outcome.names == {"last": "b"}
    assert tree.outcome.numbers == {"failed": 1, "children": 2}


def clocked(tree):
    context = Context.__new__(Context)
    context.times = np.zeros(1)
    for node in tree.iterate():
        node.setup(context=context)
    return context


def test_timeout_counts_episode_time():
    leaf = Scripted("R")
    tree = trees.timeout(0.15, leaf)
    context = clocked(tree)
    out = ""
    for tick in range(5):
        context.times = np.array([7.0 + sum([0.05] * tick)])
        out += ticks(tree, 1)
    assert out == "RRRFR"
    assert leaf.log == "RRRxR"


def test_timeout_names_what_was_not_done():
    tree = trees.timeout(0.1, Scripted("R"))
    context = clocked(tree)
    tree.tick_once()
    context.times = np.array([0.1])
    tree.tick_once()
    assert tree.status == Status.FAILURE
    assert tree.outcome == TIMED_OUT(AT_WORK(TEXT(text="answer 1"), node="leaf"), limit=0.1)


def test_timeout_lets_a_result_through():
    tree = trees.timeout(10, Scripted("RS"))
    clocked(tree)
    assert ticks(tree, 4) == "RSRS"


def test_timeout_needs_a_context():
    tree = trees.timeout(1, Scripted("R"))
    with pytest.raises(InputError, match="counts episode time and needs a context"):
        tree.setup()
    with pytest.raises(RuntimeError, match="before it was set up"):
        tree.tick_once()


def test_a_subtree_passes_everything_through():
    tree = trees.subtree("inner", Scripted("RSF"))
    assert ticks(tree, 3) == "RSF"
    assert tree.feedback_message == "answer 3"
    tree = trees.subtree("inner", Scripted("R"))
    tree.tick_once()
    tree.stop(Status.INVALID)
    assert tree.decorated.log == "Rx"


def test_a_tick_can_be_suspended_before_a_leaf_updates():
    leaf = Scripted("RFS")
    tree = trees.retry(2, leaf)
    for _ in range(2):
        walk = tree.tick()
        assert next(walk) is leaf
        list(walk)
    assert tree.status == Status.SUCCESS
