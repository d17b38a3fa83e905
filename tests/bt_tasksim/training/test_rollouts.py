"""Episodes of rollouts: the same whatever the workers, and one sentence where one of them goes wrong."""

import numpy as np
import pytest
import toys
from toys import SCENE, Check, Even, Raise, Unprogrammed, alone

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.workers import Workers
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import done_share
from bt_tasksim.training.collectors import DrawTask, RolloutTask
from bt_tasksim.training.env import EpisodeEnv
from bt_tasksim.training.episode_batch import EpisodeBatch
from bt_tasksim.training.rollouts import in_batch, results
from bt_tasksim.trees import sequence
from bt_tasksim.trees.nodes.train import Train

UP = Network(
    np.zeros(3), np.ones(3), [(np.array([[3.0, 0, 0], [-10.0, 0, 0]]), np.array([0.0, 1.0]))]
).arrays()
"""Brings the tool up and says so; noise apart."""


def make(tree=None, kind=EpisodeEnv, **settings):
    return kind(sequence("s", Even(), Train(Raise()), Check()) if tree is None else tree, SCENE, **settings)


def kept(tree=None, worlds=1):
    """What a worker keeps."""
    return make(tree, EpisodeBatch, worlds=worlds)


def task(number, network=UP, std=0.3, stage=None):
    return RolloutTask(network, np.full(2, std, np.float32), (7, number), stage)


def as_bytes(found):
    return {k: v.tobytes() if isinstance(v, np.ndarray) else v for k, v in vars(found).items()}


def run(tasks, count, maker=kept):
    with Workers(maker, count) as pool:
        return dict(enumerate(map(as_bytes, results(pool, tasks, count))))


@pytest.fixture
def maker(toy_engines):
    """Makes the environment, here and in workers, which are forked."""
    return make


def test_an_episode_brings_back_all_its_decisions(maker):
    found = [alone(maker(), task(k)) for k in range(12)]
    for episode in found:
        n = episode.end.decisions
        assert episode.features.shape == (n, 3) and episode.actions.shape == (n, 2)
        assert episode.features.dtype == episode.actions.dtype == np.float32
        assert episode.rewards.shape == (n,) and episode.cut is None
        assert episode.end.total == pytest.approx(float(episode.rewards.sum()), abs=1e-5)
    ends = [episode.end for episode in found]
    assert any(end.success for end in ends) and sum(episode.redrawn for episode in found) > 0
    assert {end.reason for end in ends} <= {"success", "follower failed", "timeout"}
    assert len({end.decisions for end in ends}) > 1


def test_a_truncated_episode_is_marked(maker):
    still = Network(np.zeros(3), np.ones(3), [(np.zeros((2, 3)), np.zeros(2))]).arrays()
    env = EpisodeEnv(sequence("s", Train(Raise()), Check()), SCENE, longest=0.2)
    found = alone(env, task(0, network=still, std=0.0))
    assert len(found.rewards) == 5 and found.end.reason == "failed"
    assert found.cut is not None and found.cut.shape == (3,)


def test_episodes_are_the_same_whatever_the_workers_and_their_order(maker):
    tasks = [task(k) for k in range(7)]
    here = {k: as_bytes(alone(maker(), task)) for k, task in enumerate(tasks)}
    assert run(tasks, 1) == run(tasks, 2) == run(tasks, 2, lambda: kept(worlds=3)) == here
    back = run(tasks[::-1], 2)
    assert [back[k] for k in range(7)] == [here[6 - k] for k in range(7)]
    assert len({row["features"] for row in here.values()}) == 7, "and no two are alike"


def test_episodes_go_on_side_by_side_and_a_free_world_takes_the_next(maker):
    batch = kept(sequence("s", Train(Raise()), Check()), worlds=8)
    found = dict(in_batch(batch, [task(k) for k in range(20)]))
    (worlds,) = toys.Worlds.made
    decisions = sum(len(episode.rewards) for episode in found.values())
    assert len(found) == 20 and max(worlds.sizes) == 8
    assert len(worlds.sizes) < decisions / 3, "one after the other each would take a step at least"
    assert len(batch.waiting) == 0


def test_an_episode_that_there_is_not_is_an_error_and_all_others_are_left(maker):
    batch = kept(worlds=4)
    with pytest.raises(InputError, match="has 0 stages, and none number 3"):
        list(in_batch(batch, [task(0), task(1), task(2, stage=3)]))
    assert len(batch.waiting) == 0
    assert len(dict(in_batch(batch, [task(0), task(1)]))) == 2, "and it can be used again"


def test_held_apart_draws_are_judged_without_noise_and_apart(maker):
    env = maker()
    tasks = [DrawTask(UP, k) for k in range(8)]
    found = [alone(env, task) for task in tasks]
    assert [k for k, _, _ in found] == list(range(8))
    reached = [SCENE.sample(k, "validation").objects[0].pose[0] > 0.5 for k in range(8)]
    assert [won for _, won, _ in found] == reached and 0 < sum(reached) < 8
    assert all("was not reached" in why for _, won, why in found if not won)
    assert [alone(env, task) for task in tasks[::-1]] == found[::-1]


def test_in_a_held_apart_draw_each_leaf_adds_up_its_own_signals(maker):
    """As in a tree that runs: what the first leaf's signals come to is not the second one's."""
    hints = Network(np.zeros(3), np.ones(3), [(np.zeros((2, 3)), np.array([0.0, 0.2]))], signal_std=0.4)
    each = np.ceil(1.0 / done_share(np.float32(0.2), 0.4))
    leaves = Raise(name="first"), Raise(name="second")
    batch = kept(Train(sequence("i", *leaves)), worlds=2)
    list(in_batch(batch, [DrawTask(hints.arrays(), 0)]))
    assert [len(leaf.log) for leaf in leaves] == [each, each] and each > 2


def test_a_worker_that_finds_an_error_says_it(maker):
    with pytest.raises(InputError, match="leaf 'first' has no policy yet"):
        run([task(0)], 1, lambda: kept(sequence("s", Unprogrammed(name="first"), Train(Raise()))))
    with pytest.raises(InputError, match="has 0 stages, and none number 3"):
        run([task(0, stage=3)], 1)
