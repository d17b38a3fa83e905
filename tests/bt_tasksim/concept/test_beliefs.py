"""Corrections come with the first sight of an object, go with it in the hand, and end with the episode."""

from types import SimpleNamespace

import numpy as np
import pytest

from bt_tasksim.concept.beliefs import Beliefs
from bt_tasksim.core import poses
from bt_tasksim.scene.scene import Scene

SCENE = Scene("panda", objects={"box": "box on table", "cup": "cup on table"})


@pytest.fixture
def world():
    drawn = SCENE.sample(5)
    return drawn.world_model(["left", "right"], 0.08), np.array([actor.pose for actor in drawn.objects])


def higher(true, by):
    return true + np.array([0.0, 0.0, by, 0.0, 0.0, 0.0, 0.0])


def seen(*objects):
    return SimpleNamespace(objects=np.stack(objects))


def corrected(beliefs, model, observation):
    found = beliefs.corrections(list(model.index), observation.objects)
    return observation.objects if found is None else poses.multiply(observation.objects, found)


def test_what_was_seen_too_high_is_taken_to_be_as_much_lower_ever_after(world):
    model, true = world
    wrong = higher(true, 0.015)
    beliefs = Beliefs(1)
    beliefs.begin(np.array([0]), [model])
    beliefs.see(seen(wrong))
    assert np.allclose(corrected(beliefs, model, seen(wrong))[0], true)
    moved = poses.multiply(
        poses.pose([0.1, -0.2, 0.3], poses.from_rotation_vector(np.array([0.5, 1.0, 0.2]))), true
    )
    carried = poses.multiply(moved, poses.multiply(poses.inverse(true), wrong))
    beliefs.see(seen(carried))
    assert np.allclose(corrected(beliefs, model, seen(carried))[0], moved)


def test_each_object_is_put_right_when_it_is_first_seen(world):
    model, true = world
    hidden = true.copy()
    hidden[1] = np.nan
    beliefs = Beliefs(1)
    beliefs.begin(np.array([0]), [model])
    beliefs.see(seen(hidden))
    assert beliefs.corrections(list(model.index), true) is None, "the box was seen as it is"
    later = higher(true, 0.01)
    beliefs.see(seen(later))
    found = corrected(beliefs, model, seen(later))[0]
    assert np.allclose(found[1], true[1]) and np.allclose(found[0], later[0])


def test_worlds_have_their_own_and_forget_them_at_the_next_begin(world):
    model, true = world
    wrong = higher(true, 0.015)
    beliefs = Beliefs(2)
    beliefs.begin(np.arange(2), [model, model])
    beliefs.see(seen(true, wrong))
    first, second = corrected(beliefs, model, seen(true, wrong))
    assert np.allclose(first, true) and np.allclose(second, true)
    beliefs.begin(np.array([1]), [model])
    beliefs.see(seen(true, true))
    assert beliefs.corrections(list(model.index), true) is None


def test_columns_may_stand_in_another_order(world):
    model, true = world
    wrong = true + np.outer([1.0, 0.0], [0.0, 0.0, 0.015, 0.0, 0.0, 0.0, 0.0])
    beliefs = Beliefs(1)
    beliefs.begin(np.array([0]), [model])
    beliefs.see(seen(wrong))
    found = beliefs.corrections(["other", "cup", "box"], true)
    assert np.allclose(found[0, :2, :3], 0.0) and found[0, 2, 2] == pytest.approx(-0.015)
