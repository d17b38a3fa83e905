"""The posture of a command: it belongs to the tool's target, and reaches the engines with it."""

import numpy as np
import pytest

from bt_tasksim.core.errors import LeafError
from bt_tasksim.core.world import Command

TOOL, JOINTS = np.array([0.4, 0.0, 0.3, 0.0, 1.0, 0.0, 0.0]), np.linspace(0.0, 0.6, 7)


def commanding(act, posture, **settings):
    leaf = act("a", **settings)
    leaf.model.command = lambda action, seen, memory: Command(tool=TOOL[None], posture=posture)
    return leaf


def test_it_comes_with_the_tool(toy, act):
    stage = toy(commanding(act, JOINTS[None]))
    stage.tick()
    assert np.array_equal(stage.world.steps[-1].tool, TOOL)
    assert np.array_equal(stage.world.steps[-1].posture, JOINTS)


@pytest.mark.parametrize("posture", [None, np.full((1, 7), np.nan)])
def test_none_and_nan_are_none(toy, act, posture):
    stage = toy(commanding(act, posture))
    stage.tick()
    found = stage.world.steps[-1].posture
    assert found is None or np.isnan(found).all()


def test_one_of_other_rows_is_an_error_that_names_the_leaf(toy, act):
    stage = toy(commanding(act, JOINTS))
    with pytest.raises(LeafError, match="leaf 'a' commands a posture of shape"):
        stage.tick()


def test_over_another_command_it_goes_with_the_tool():
    hand = np.array([0.5])
    held = Command(tool=TOOL, hand=hand, posture=JOINTS)
    assert Command(hand=hand).over(held).posture is JOINTS
    assert Command(tool=TOOL).over(held).posture is None, "a new target without one has none"
    assert Command(tool=TOOL, posture=JOINTS + 1).over(held).hand is hand
