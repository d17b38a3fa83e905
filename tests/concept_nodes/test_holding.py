"""When an object counts as held."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.checking.situations import whole
from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Pick, Place
from bt_tasksim.concept_nodes.holding import HOLDING, NOT_HELD, holding, not_held, tool_distance
from bt_tasksim.core import poses
from bt_tasksim.core.world import Observation


@pytest.fixture
def seen(toy):
    stage = toy(Pick("box"))
    stage.world.hold("box")
    stage.look()
    seen = stage.context.seen(ONE, np.zeros(1))
    seen.observation = whole(Observation, seen.observation)
    return seen


def with_tool(seen, local):
    """The same view, with the tool at a point of the box's frame."""
    tool = poses.pose(poses.transform(seen.object("box")[0], np.asarray(local, float)), seen.tool[0, 3:])[
        None
    ]
    seen.observation = dataclasses.replace(seen.observation, tool_pose=tool)
    return seen


def test_distance_to_the_box(seen):
    half = seen.model("box").extent[0] / 2
    assert tool_distance(with_tool(seen, [0, 0, 0]), "box") == [0.0]
    assert tool_distance(with_tool(seen, 0.99 * half), "box") == [0.0]
    assert tool_distance(with_tool(seen, [0, 0, half[2] + 0.04]), "box") == pytest.approx([0.04])
    assert tool_distance(with_tool(seen, half + 0.03), "box") == pytest.approx([0.03 * np.sqrt(3)])


@pytest.mark.parametrize("contacts", [(0, 0), (1, 0), (0, 1), (1, 1)])
def test_both_sides_must_touch(seen, contacts):
    seen.observation = dataclasses.replace(seen.observation, contacts=np.array([contacts], bool))
    assert holding(seen, "box").tolist() == [contacts == (1, 1)]


@pytest.mark.parametrize(("gap", "held"), [(0.029, True), (0.031, False)])
def test_it_must_be_near(seen, gap, held):
    half = seen.model("box").extent[0, 2] / 2
    seen = with_tool(seen, [0, 0, half + gap])
    assert holding(seen, "box").tolist() == [held]
    assert holding(seen, "box", reach=0.1).tolist() == [True]
    possible = not_held(seen, "box")
    assert possible.applies.tolist() == [not held]
    assert possible.at(0).is_a(NOT_HELD) and possible.at(0).numbers["distance"] == pytest.approx(gap)


@pytest.mark.parametrize("robot", ["panda", "xarm7_ability"])
def test_opposition_is_any_of_each_group(rows_alike, robot):
    from bt_tasksim.concept.seen import Seen
    from bt_tasksim.robot.description import load_robot

    description = load_robot(robot)
    n = len(description.tips)
    patterns = np.array(np.meshgrid(*[[False, True]] * n)).reshape(n, -1).T
    expected = np.all([patterns[:, list(group)].any(axis=-1) for group in description.opposition], axis=0)
    empty = {f.name: None for f in dataclasses.fields(Observation)}

    def opposed(rows):
        observation = Observation(**{**empty, "contacts": patterns[rows]})
        return Seen(observation, None, description, np.zeros(len(rows))).opposed()

    assert np.array_equal(rows_alike(opposed, len(patterns)), expected)


@pytest.mark.parametrize(
    ("contacts", "gap", "may_be"), [((1, 0), 0.0, True), ((0, 0), 0.0, False), ((1, 0), 0.01, False)]
)
def test_what_one_finger_touches_between_the_others_may_be_held(seen, contacts, gap, may_be):
    half = seen.model("box").extent[0, 2] / 2
    seen = with_tool(seen, [0, 0, half + gap])
    seen.observation = dataclasses.replace(seen.observation, contacts=np.array([contacts], bool))
    assert not holding(seen, "box")[0]
    assert not_held(seen, "box").applies.tolist() == [not may_be]
    for leaf in (Pick("box"), Place("box", on="goal")):
        kept = leaf.model.maintained(HOLDING, seen, None)
        assert kept.tolist() == [may_be], "what a concept begins with it does not lose at once"
