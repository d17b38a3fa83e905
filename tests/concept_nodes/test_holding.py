"""When an object counts as held."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.concept_nodes import Pick
from bt_tasksim.concept_nodes.holding import NOT_HELD, holding, not_held, tool_distance
from bt_tasksim.core import poses


@pytest.fixture
def seen(toy):
    stage = toy(Pick("box"))
    stage.world.hold("box")
    stage.look()
    return stage.context.seen(0.0)


def with_tool(seen, local):
    """The same view, with the tool at a point of the box's frame."""
    tool = poses.pose(poses.transform(seen.object("box"), np.asarray(local, float)), seen.tool[3:])
    seen.observation = dataclasses.replace(seen.observation, tool_pose=tool)
    return seen


def test_distance_to_the_box(seen):
    half = np.array(seen.model("box").extent) / 2
    assert tool_distance(with_tool(seen, [0, 0, 0]), "box") == 0.0
    assert tool_distance(with_tool(seen, 0.99 * half), "box") == 0.0
    assert tool_distance(with_tool(seen, [0, 0, half[2] + 0.04]), "box") == pytest.approx(0.04)
    assert tool_distance(with_tool(seen, half + 0.03), "box") == pytest.approx(0.03 * np.sqrt(3))


@pytest.mark.parametrize("contacts", [(0, 0), (1, 0), (0, 1), (1, 1)])
def test_both_sides_must_touch(seen, contacts):
    seen.observation = dataclasses.replace(seen.observation, contacts=np.array(contacts, bool))
    assert bool(holding(seen, "box")) is (contacts == (1, 1))


@pytest.mark.parametrize(("gap", "held"), [(0.029, True), (0.031, False)])
def test_it_must_be_near(seen, gap, held):
    half = seen.model("box").extent[2] / 2
    seen = with_tool(seen, [0, 0, half + gap])
    assert bool(holding(seen, "box")) is held
    assert bool(holding(seen, "box", reach=0.1))
    outcome = not_held(seen, "box")
    assert (outcome is None) is held
    assert held or (outcome.is_a(NOT_HELD) and outcome.numbers["distance"] == pytest.approx(gap))


@pytest.mark.parametrize("robot", ["panda", "xarm7_ability"])
def test_opposition_is_any_of_each_group(robot):
    from bt_tasksim.concept.seen import Seen
    from bt_tasksim.core.world import Observation
    from bt_tasksim.robot.description import load_robot

    description = load_robot(robot)
    n = len(description.tips)
    patterns = np.array(np.meshgrid(*[[False, True]] * n)).reshape(n, -1).T
    expected = np.all([patterns[:, list(group)].any(axis=-1) for group in description.opposition], axis=0)
    empty = {f.name: None for f in dataclasses.fields(Observation)}
    batch = Seen(Observation(**{**empty, "contacts": patterns}), None, description, 0.0).opposed()
    assert np.array_equal(batch, expected)
    for pattern, answer in zip(patterns, expected, strict=True):
        one = Seen(Observation(**{**empty, "contacts": pattern}), None, description, 0.0).opposed()
        assert bool(one) is bool(answer)
