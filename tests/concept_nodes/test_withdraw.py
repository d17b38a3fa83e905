"""Withdraw: opens before it draws back, and is done whatever is in its way."""

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.concept_nodes import Pick, Withdraw
from bt_tasksim.core import poses


def test_each_world_begins_as_alone(situations):
    found = situations(Pick).check("begin", Withdraw.value())
    assert all(memory.start.shape == (1,) for memory in found)


@pytest.mark.parametrize("direction", [None, (-1.0, 0.0, 0.0)])
def test_it_opens_then_draws_back(toy, direction):
    stage = toy(Withdraw(distance=0.1, direction=direction, opening=0.6))
    stage.world.hold("cup")
    stage.look()
    first = stage.world.now.tool_pose.copy()
    assert stage.tick(200) == Status.SUCCESS
    tools = np.array([command.tool for command in stage.world.steps])
    hands = np.array([command.hand[0] for command in stage.world.steps])
    assert hands[0] == pytest.approx(0.5) and np.all(np.diff(hands) <= 1e-12) and hands[-1] == 0.0
    moved = np.linalg.norm(tools[:, :3] - first[:3], axis=-1)
    assert np.all(moved[hands > 0.0] < 1e-9), "it draws back only when the hand is open"
    back = -poses.rotate(first[3:], np.array([0.0, 0, 1])) if direction is None else np.array(direction)
    assert np.allclose(tools[-1][:3] - first[:3], 0.1 * back, atol=1e-3)


def test_it_ends_though_the_tool_is_held_up(toy):
    stage = toy(Withdraw(distance=0.1))
    step, still = stage.world.step, stage.world.now.tool_pose.copy()

    def stuck(command):
        step(command)
        stage.world.put(tool_pose=still)
        return stage.world.now

    stage.world.step = stuck
    assert stage.tick(200) == Status.SUCCESS and stage.context.now > 1.6
    assert stage.tree.outcome.detail.numbers["distance"] == pytest.approx(0.1)
