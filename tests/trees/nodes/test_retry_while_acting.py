"""A retry that ends with an attempt in which nothing has acted."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim import trees
from bt_tasksim.concept.reporting import speaker, whole_outcome
from bt_tasksim.core.outcomes import FAILED
from bt_tasksim.trees.nodes.retry import ATTEMPT_FAILED
from bt_tasksim.trees.nodes.retry_while_acting import NOTHING_DONE


class Attempts(Behaviour):
    """Acts for so many ticks in each attempt, and fails then; succeeds after the last one."""

    def __init__(self, ticks):
        super().__init__("attempts")
        self.ticks, self.begun, self.left = ticks, 0, 0

    def initialise(self):
        self.begun += 1
        self.left = self.ticks[self.begun - 1] if self.begun <= len(self.ticks) else 0

    def update(self):
        self.left -= 1
        if self.left >= 0:
            return Status.RUNNING
        self.feedback_message = f"attempt {self.begun}"
        return Status.SUCCESS if self.begun > len(self.ticks) else Status.FAILURE


def run(tree):
    for _ in range(200):
        tree.tick_once()
        if tree.status != Status.RUNNING:
            return tree.status
    raise AssertionError("it does not end")


@given(st.lists(st.integers(0, 3), max_size=5), st.sampled_from([-1, 1, 2, 3, 4]))
def test_it_ends_with_success_the_limit_or_an_attempt_without_acting(ticks, limit):
    leaf = Attempts(ticks)
    tree = trees.retry_while_acting(limit, leaf)
    idle = ticks.index(0) + 1 if 0 in ticks else len(ticks) + 1
    most = min(idle, len(ticks) + 1, limit if limit > 0 else len(ticks) + 1)
    status = run(tree)
    assert leaf.begun == most
    assert status == (Status.SUCCESS if most == len(ticks) + 1 else Status.FAILURE)
    again = run(tree)
    assert again == Status.SUCCESS or leaf.begun > most, "it counts anew"


def test_it_says_that_nothing_was_done_and_why():
    tree = trees.retry_while_acting(9, Attempts([2, 0]))
    assert run(tree) == Status.FAILURE
    found = whole_outcome(speaker(tree))
    assert found.is_a(NOTHING_DONE) and not found.is_a(ATTEMPT_FAILED)
    assert found.cause == FAILED(text="attempt 2") and "attempt 1" in found.names["before"]


def test_where_it_acts_to_the_last_it_says_what_a_retry_says():
    ours, usual = trees.retry_while_acting(2, Attempts([1, 1])), trees.retry(2, Attempts([1, 1]))
    assert run(ours) == run(usual) == Status.FAILURE
    assert whole_outcome(speaker(ours)) == whole_outcome(speaker(usual))
