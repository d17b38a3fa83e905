"""All children in an order found on the way: what has its turn when, how it ends, and what it says."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim import trees
from bt_tasksim.concept.reporting import speaker, whole_outcome
from bt_tasksim.concept_nodes import Wait
from bt_tasksim.core.outcomes import FAILED
from bt_tasksim.trees.nodes.any_order import OTHERS_COULD_NOT_BEGIN


@dataclass
class World:
    """What has become of tasks."""

    done: set[int] = field(default_factory=set)
    tried: list[int] = field(default_factory=list)
    begun: list[int] = field(default_factory=list)


class Task(Behaviour):
    """Begins once others are done, and is done after some ticks, or fails then."""

    def __init__(self, number, world, needs=(), ticks=1, fails=False):
        super().__init__(f"task {number}")
        self.number, self.world, self.needs = number, world, set(needs)
        self.ticks, self.fails, self.left = ticks, fails, 0

    def initialise(self):
        self.world.tried.append(self.number)
        self.left = self.ticks

    def update(self):
        if not self.needs <= self.world.done:
            self.feedback_message = f"{self.number} has to wait"
            return Status.FAILURE
        if self.left == self.ticks:
            self.world.begun.append(self.number)
        self.left -= 1
        if self.left >= 0:
            return Status.RUNNING
        if self.fails:
            self.feedback_message = f"{self.number} went wrong"
            return Status.FAILURE
        self.world.done.add(self.number)
        return Status.SUCCESS


def run(tree, most=200):
    for count in range(1, most):
        tree.tick_once()
        if tree.status != Status.RUNNING:
            return count
    raise AssertionError("it does not end")


def made(needs, ticks=1, fails=()):
    world = World()
    tasks = [Task(k, world, need, ticks, k in fails) for k, need in enumerate(needs)]
    return trees.any_order("all", *tasks), world


def test_nothing_to_do_is_done_at_once():
    tree, _ = made([])
    assert run(tree) == 1 and tree.status == Status.SUCCESS


def test_what_can_begin_is_done_from_left_to_right():
    tree, world = made([(), (), ()])
    assert run(tree) == 4 and tree.status == Status.SUCCESS
    assert world.begun == world.tried == [0, 1, 2]


def test_what_cannot_begin_waits_until_another_one_has_acted():
    tree, world = made([{2}, (), ()])
    run(tree)
    assert tree.status == Status.SUCCESS and world.tried == [0, 1, 2, 0]


def test_nothing_is_tried_twice_while_nothing_acts():
    tree, world = made([{1}, {0}, {0}])
    assert run(tree) == 1 and tree.status == Status.FAILURE and world.tried == [0, 1, 2]


def test_where_nothing_can_begin_it_is_told_by_what_failed_last():
    tree, _ = made([{9}, (), {9}])
    run(tree)
    assert speaker(tree).name == "task 0" and tree.tip().name == "task 0", "after task 1 has acted"
    tree, _ = made([{9}, {9}, {9}])
    run(tree)
    assert speaker(tree).name == "task 2" and tree.tip().name == "task 2"
    said = whole_outcome(speaker(tree)).sentence
    assert said.endswith(": 2 has to wait") and "task 0: 0 has to wait; task 1: 1 has to wait" in said


def test_a_task_that_goes_wrong_ends_all_and_what_could_not_begin_is_said():
    tree, world = made([{2}, (), ()], fails={1})
    run(tree)
    assert tree.status == Status.FAILURE and world.tried == [0, 1]
    found = whole_outcome(speaker(tree))
    assert found.is_a(OTHERS_COULD_NOT_BEGIN) and found.cause == FAILED(text="1 went wrong")
    assert "task 0: 0 has to wait" in found.sentence


def test_it_begins_anew_after_its_end_and_after_an_interruption():
    tree, world = made([(), ()], ticks=2)
    tree.tick_once()
    tree.stop(Status.INVALID)
    assert all(child.status == Status.INVALID for child in tree.children)
    run(tree)
    assert world.begun == [0, 0, 1] and tree.status == Status.SUCCESS
    run(tree)
    assert world.begun == [0, 0, 1, 0, 1]


def test_waiting_for_another_attempt_is_not_acting():
    world = World()
    stuck = trees.retry(3, Task(0, world, {9}))
    tree = trees.any_order("all", stuck, Task(1, world))
    run(tree)
    assert world.done == {1} and world.tried == [0, 0, 0, 1, 0, 0, 0]
    assert "0 has to wait" in whole_outcome(speaker(tree)).sentence


@st.composite
def tasks(draw):
    """For each task, those that it needs, in circles too; and how many ticks each takes."""
    count = draw(st.integers(1, 6))
    needs = [draw(st.sets(st.sampled_from(range(count)), max_size=2)) - {k} for k in range(count)]
    return needs, draw(st.integers(1, 3))


@given(tasks())
def test_all_is_done_that_can_be_done_once_each_and_the_rest_is_named(drawn):
    needs, ticks = drawn
    possible: set[int] = set()
    while more := {k for k, need in enumerate(needs) if need <= possible} - possible:
        possible |= more
    tree, world = made(needs, ticks)
    assert run(tree) == ticks * len(possible) + 1
    assert world.done == possible and sorted(world.begun) == sorted(possible)
    assert len(world.tried) <= len(needs) * (len(possible) + 1)
    everything = len(possible) == len(needs)
    assert tree.status == (Status.SUCCESS if everything else Status.FAILURE)
    if not everything:
        said = whole_outcome(speaker(tree)).sentence
        assert all(f"{k} has to wait" in said for k in set(range(len(needs))) - possible)
    if all(max(need, default=-1) < k for k, need in enumerate(needs)):
        assert world.tried == sorted(possible), "an order that works is kept"


@pytest.mark.parametrize(
    ("name", "build"),
    [
        ("AnyOrder", lambda: trees.any_order("x", Wait(1.0))),
        ("RetryWhileActing", lambda: trees.retry_while_acting(3, Wait(1.0))),
    ],
)
def test_a_file_declares_it(name, build):
    text = trees.tree_to_xml(build())
    assert f'ID="{name}"' in text.partition("TreeNodesModel")[2]
    assert trees.same_tree(trees.tree_from_xml(text), build())
