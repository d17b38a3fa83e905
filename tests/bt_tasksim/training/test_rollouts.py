"""Environments: the same whatever the number of workers, and one sentence where a worker goes wrong."""

import numpy as np
import pytest
import toys
from toys import SCENE, Check, Even, Raise, Unprogrammed, alone

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.workers import Workers
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import done_share
from bt_tasksim.training.collectors import DrawTask, RolloutTask
from bt_tasksim.training.endings import Ending
from bt_tasksim.training.env import EpisodeEnv
from bt_tasksim.training.episode_batch import EpisodeBatch
from bt_tasksim.training.judge import FOLLOWED, SignalOutcome
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


def environment(number, decisions=40, network=UP, std=0.3, stage=None, **settings):
    return RolloutTask(network, np.full(2, std, np.float32), (7, number), decisions, stage, **settings)


def as_bytes(found):
    return {k: v.tobytes() if isinstance(v, np.ndarray) else v for k, v in vars(found).items()}


def run(tasks, count, maker=kept):
    with Workers(maker, count) as pool:
        return dict(enumerate(map(as_bytes, results(pool, tasks, count))))


@pytest.fixture
def maker(toy_engines):
    """Makes the environment, here and in workers, which are forked."""
    return make


def test_an_environment_is_whole_episodes_in_a_row(maker):
    found = alone(maker(), environment(0, decisions=60))
    assert found.features.shape == (60, 3) and found.actions.shape == (60, 2)
    assert found.features.dtype == found.actions.dtype == np.float32
    assert found.starts[0] and int(found.starts.sum()) in (len(found.ends), len(found.ends) + 1)
    lengths = [end.decisions for end in found.ends]
    assert (
        np.flatnonzero(found.starts).tolist() == [0, *np.cumsum(lengths).tolist()][: int(found.starts.sum())]
    )
    first = lengths[0]
    assert found.ends[0].total == pytest.approx(float(found.rewards[:first].sum()), abs=1e-5)
    assert len(lengths) > 3 and any(end.success for end in found.ends) and found.redrawn > 0
    assert {end.reason for end in found.ends} <= {"success", "follower failed", "timeout"}
    # It was cut off in the middle of an episode, or ended with one.
    assert (found.cut_at.tolist() == [59]) == (sum(lengths) < 60)


def test_a_truncated_episode_is_marked(maker):
    def short():
        return EpisodeEnv(sequence("s", Train(Raise()), Check()), SCENE, longest=0.2)

    still = Network(np.zeros(3), np.ones(3), [(np.zeros((2, 3)), np.zeros(2))]).arrays()
    found = alone(short(), environment(0, decisions=12, network=still, std=0.0))
    assert found.cut_at.tolist() == [4, 9, 11] and found.cut.shape == (3, 3)
    assert [end.reason for end in found.ends] == ["failed", "failed"]
    assert found.starts.tolist() == [k in (0, 5, 10) for k in range(12)]


def test_environments_are_the_same_whatever_the_workers_and_their_order(maker):
    tasks = [environment(k) for k in range(5)]
    here = {k: as_bytes(alone(maker(), task)) for k, task in enumerate(tasks)}
    assert run(tasks, 1) == run(tasks, 2) == run(tasks, 2, lambda: kept(worlds=3)) == here
    back = run(tasks[::-1], 2)
    assert [back[k] for k in range(5)] == [here[4 - k] for k in range(5)]
    assert len({row["features"] for row in here.values()}) == 5, "and no two are alike"


@pytest.mark.parametrize("length", [1.0, 20.0, 1000.0])
def test_how_long_episodes_are_thought_to_be_changes_nothing(maker, length):
    expected = [as_bytes(alone(maker(), environment(k))) for k in range(2)]
    tasks = [environment(k, length=length) for k in range(2)]
    for worlds in (1, 7):
        found = dict(in_batch(kept(worlds=worlds), tasks))
        assert [as_bytes(found[k]) for k in range(2)] == expected


def test_episodes_of_one_environment_go_on_side_by_side(maker):
    batch = kept(sequence("s", Train(Raise()), Check()), worlds=8)
    ((_, found),) = in_batch(batch, [environment(0, decisions=100, length=12.0)])
    (worlds,) = toys.Worlds.made
    assert len(found.features) == 100 and max(worlds.sizes) == 8
    assert len(worlds.sizes) < 60, "of them one after the other there would be more than 100"
    assert len(batch.waiting) == 0, "those that go on beyond are left"


RIGHT = SignalOutcome(True, "SUCCESS", FOLLOWED(node="it"))
GOOD = Ending("success", RIGHT.outcome, False, True, RIGHT, "SUCCESS", 1.0)


def played(episode, decisions, ends=True):
    """An episode of so many decisions, in no world; the number is what is seen, decided and paid."""
    assert episode.begin().stream == "training"
    episode.began(0)
    for k in range(decisions):
        episode.action(np.full(3, k, np.float32), np.zeros(2, np.float32))
        episode.paid(np.full(3, k + 1, np.float32), float(k), GOOD if ends and k == decisions - 1 else None)


def test_an_episode_that_ran_on_is_cut_where_the_environment_ends():
    collector = environment(0, decisions=10, length=4.0).collector(Network.from_arrays(UP))
    first, second, third = (collector.next() for _ in range(3))
    played(second, 9, ends=False)
    played(third, 3)
    assert not collector.done and collector.counts(first) and collector.counts(second)
    assert collector.counts(third) is False, "what it has to come after may yet be enough, and it is over"
    played(first, 4)
    assert collector.done
    found = collector.result()
    assert found.rewards.tolist() == [0, 1, 2, 3, 0, 1, 2, 3, 4, 5]
    assert np.flatnonzero(found.starts).tolist() == [0, 4]
    assert found.cut_at.tolist() == [9] and found.cut.tolist() == [[6.0, 6.0, 6.0]]
    assert [end.decisions for end in found.ends] == [4]


def test_an_episode_that_there_is_not_is_an_error_only_where_it_counts():
    for decisions, raised in ((8, False), (9, True)):
        collector = environment(0, decisions=decisions, length=4.0).collector(Network.from_arrays(UP))
        first, second = collector.next(), collector.next()
        second.failed(InputError("there is none"))
        assert not collector.done
        played(first, 8)
        if raised:
            with pytest.raises(InputError, match="there is none"):
                _ = collector.done
        else:
            assert collector.done and len(collector.result().rewards) == 8


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
        run([environment(0)], 1, lambda: kept(sequence("s", Unprogrammed(name="first"), Train(Raise()))))
    with pytest.raises(InputError, match="has 0 stages, and none number 3"):
        run([environment(0, stage=3)], 1)
