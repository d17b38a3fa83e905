"""An episode alone: from decision to decision, and how it ends; nothing of it reaches the next one."""

import numpy as np
import pytest
from toys import SCENE, Check, Raise

from bt_tasksim.execution.runner import Runner
from bt_tasksim.policy.policy import Action
from bt_tasksim.training.episodes import Episode
from bt_tasksim.trees import sequence
from bt_tasksim.trees.nodes.train import Train, train_nodes

STILL = Action(np.zeros((1, 1)), np.array([False]))
DONE = Action(np.zeros((1, 1)), np.array([True]))


@pytest.fixture
def episode_of(toy_engines):
    """Makes episodes of one tree: ``episode_of(draw)``."""
    tree = sequence("s", Train(Raise()), Check())
    (train,) = train_nodes(tree)
    for leaf in train.learners():
        leaf.under_training = True
    runner = Runner(tree, SCENE)
    return lambda draw=0, longest=30.0: (
        setattr(runner, "longest", longest) or Episode(runner, train, SCENE.sample(draw, "training"))
    )


def played(episode, action):
    decisions = 0
    while (decision := episode.next_decision()) is not None:
        assert episode.waiting is decision
        decision.leaf.decide(action)
        decisions += 1
    assert episode.waiting is None
    return decisions, episode.ending()


def test_a_wrong_signal_is_judged_by_what_follows(episode_of):
    decisions, ending = played(episode_of(), DONE)
    assert decisions == 1 and ending.end == "failure" and not ending.is_success
    assert ending.status == "SUCCESS" and ending.judged.status == "FAILURE"
    assert not ending.truncated and not ending.kept


def test_without_a_signal_nobody_judges(episode_of):
    decisions, ending = played(episode_of(), STILL)
    assert decisions > 1 and ending.end == "timeout" and ending.judged is None


def test_what_ends_it_from_outside_truncates_it(episode_of):
    _, ending = played(episode_of(longest=0.2), STILL)
    assert ending.end == "cut" and ending.truncated and ending.kept


def test_without_a_sufficient_reward_nothing_is_paid_for_the_signal(episode_of):
    episode = episode_of()
    episode.next_decision().leaf.decide(DONE)
    assert episode.next_decision() is None
    assert episode.ending(sufficient=False).end == "cut" and episode.ending(sufficient=False).kept


def test_one_that_was_left_in_the_middle_leaves_nothing_behind(episode_of):
    whole = played(episode_of(), STILL)
    left = episode_of()
    left.next_decision()
    left.close()
    assert left.waiting is None
    assert played(episode_of(), STILL) == whole
