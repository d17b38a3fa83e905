"""Which of two objects is which matters unless all that is said of one is said of the other."""

import dataclasses

import pytest

from bt_tasksim.scene.configuration import Disturbance
from bt_tasksim.scene.interchange import told_apart
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import Goal


def world(goals):
    return Scene("panda", objects=dict.fromkeys("abc", "cube on table"), goals=goals).sample(1)


@pytest.mark.parametrize(
    ("goals", "matters"),
    [
        ([], True),  # a tree may name any of them
        ([Goal("c", "table", "anywhere")], False),
        ([Goal("a", "table", "anywhere")], True),
        ([Goal("a", "table", "anywhere"), Goal("b", "table", "anywhere")], False),
        ([Goal("a", "table", "anywhere"), Goal("b", "table", "anywhere", when="once")], True),
        ([Goal("c", on="a")], True),
        ([Goal("a", beside="c"), Goal("b", beside="c")], False),
        ([Goal("a", on="b")], True),
    ],
)
def test_it_matters_where_goals_tell_them_apart(goals, matters):
    assert told_apart(world(goals), "a", "b") == matters
    assert told_apart(world(goals), "b", "a") == matters


def test_it_matters_which_of_them_is_pushed():
    pushed = dataclasses.replace(
        world([Goal("c", "table", "anywhere")]), disturbance=Disturbance("a", 1.0, (1.0, 0.0, 0.0))
    )
    assert told_apart(pushed, "a", "b")
