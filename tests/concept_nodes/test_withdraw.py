"""Withdraw: opens before it draws back, as far as there is room, and fails where it does not come there."""

import dataclasses

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.concept_nodes import Pick, Withdraw
from bt_tasksim.concept_nodes.limits import WRIST_STRAINED
from bt_tasksim.concept_nodes.withdraw import NOT_BACK
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import LIMIT_VIOLATED, NO_WAY
from bt_tasksim.core.world import Obstacle
from bt_tasksim.trees.recovery import hand_is_free
from bt_tasksim.trees.walk import nodes_of


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


def stuck(stage, **changes):
    """Have the tool stay where it is, whatever it is told."""
    step, still = stage.world.step, stage.world.now.tool_pose.copy()

    def stay(command):
        step(command)
        stage.world.put(tool_pose=still, **changes)
        return stage.world.now

    stage.world.step = stay
    return stage


def with_obstacles(stage, *boxes):
    stage.context.begin([dataclasses.replace(stage.world.model, obstacles=boxes)])
    stage.look()
    return stage


def plate(height):
    """A plate above the arm's wrist, its middle so far above the ground."""
    return Obstacle(poses.pose([0.62, 0.0, height]), (0.3, 0.6, 0.02), "plate")


def test_it_fails_where_the_tool_is_held_up(toy):
    stage = stuck(toy(Withdraw(distance=0.1)))
    assert stage.tick(200) == Status.FAILURE and 1.6 < stage.context.now < 3.0
    assert stage.tree.outcome.is_a(LIMIT_VIOLATED) and stage.tree.outcome.is_a(NOT_BACK)
    assert stage.tree.outcome.cause.numbers["value"] == pytest.approx(0.1, abs=1e-3)


def test_it_draws_back_as_far_as_there_is_room(toy):
    gone = []
    for height in (0.9, 0.725, 0.7):
        stage = with_obstacles(toy(Withdraw(distance=0.1)), plate(height))
        before = stage.world.now.tool_pose[2]
        assert stage.tick(200) == Status.SUCCESS
        gone.append(stage.world.now.tool_pose[2] - before)
    assert gone == pytest.approx([0.1, 0.075, 0.05], abs=2e-3)


def test_where_there_is_no_room_it_says_so_and_another_way_is_tried(toy):
    tree = hand_is_free()
    stage = with_obstacles(toy(tree), plate(0.65))
    stage.world.put(closure=np.float64(0.9), contacts=np.ones(2, bool))
    stage.look()
    stage.tick(2)
    back, up, towards = (node for node in nodes_of(tree) if isinstance(node, Withdraw.leaf_class))
    for leaf in (back, up):
        assert leaf.outcome.is_a(NO_WAY) and "would touch plate" in leaf.feedback_message
        assert "the hand cannot draw back by 25 mm" in leaf.feedback_message
    assert tree.tip() is towards and towards.status == Status.RUNNING


def test_a_force_at_the_wrist_ends_it(toy):
    stage = toy(Withdraw(distance=0.1))
    stage.tick(15)
    stage.world.put(wrench=np.array([0.0, 0, 70.0, 0, 0, 0]))
    stage.look()
    assert stage.tick() == Status.FAILURE and stage.tree.outcome.is_a(WRIST_STRAINED)


def test_a_hand_that_is_pressed_on_already_may_draw_back(toy):
    """What it pressed on is what it is to be freed from."""
    for relieved in (True, False):
        stage = toy(Withdraw(distance=0.1))
        stage.world.put(wrench=np.array([0.0, 0, 70.0, 0, 0, 0]))
        stage.look()
        assert stage.tick(14) == Status.RUNNING
        if relieved:
            stage.world.put(wrench=np.zeros(6))
        assert stage.tick(200) == (Status.SUCCESS if relieved else Status.FAILURE)
