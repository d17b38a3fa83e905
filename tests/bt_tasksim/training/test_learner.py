"""The learner: the same function in NumPy and torch, whole checkpoints, no traces in global state."""

import gymnasium
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from bt_tasksim.policy.network import Network
from bt_tasksim.training.collectors import EnvironmentRollout
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.learner import Learner, Statistics

torch.set_num_threads(1)
N, M = 5, 3
CONFIG = TrainConfig(
    steps=240,
    n_envs=2,
    n_steps=30,
    epochs=2,
    minibatch=20,
    hidden=(16, 8),
    learning_rate=3e-3,
    seed=4,
)


def learner(**changes):
    boxes = (gymnasium.spaces.Box(-np.inf, np.inf, (N,), np.float32), gymnasium.spaces.Box(-1.0, 1.0, (M,)))
    return Learner(*boxes, TrainConfig(**{**CONFIG.to_dict(), "reward": CONFIG.reward, **changes}))


def environments(iteration, count=2, n=30, cut=True):
    """Made-up episodes: what is paid is how near the first action is to the first feature."""
    rng = np.random.default_rng([9, iteration])
    out = []
    for _ in range(count):
        features = rng.normal(2.0, 3.0, (n, N)).astype(np.float32)
        actions = rng.normal(0.0, 0.5, (n, M)).astype(np.float32)
        out.append(
            EnvironmentRollout(
                features=features,
                actions=actions,
                rewards=(-np.abs(actions[:, 0] - 0.1 * features[:, 0])).astype(np.float32),
                starts=np.arange(n) % 10 == 0,
                cut=features[:2] if cut else features[:0],
                cut_at=np.array([9, n - 1] if cut else [], np.int64),
                ends=[],
                redrawn=0,
            )
        )
    return out


def trained(rollouts=2, **changes):
    found = learner(**changes)
    for k in range(rollouts):
        found.update(environments(k), k + 1)
    return found


def torch_policy(found, features):
    """Mean actions of the policy that is trained, on features normalised as in training."""
    rows = torch.as_tensor(found.network.normalise(features))
    with torch.no_grad():
        return found.ppo.policy.get_distribution(rows).distribution.mean.numpy()


def same(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[k], b[k]) for k in a)


def test_numpy_and_torch_decide_alike():
    found = trained()
    features = np.random.default_rng(0).normal(2.0, 4.0, (400, N)).astype(np.float32)
    expected = torch_policy(found, features)
    assert np.abs(found.network(features) - expected).max() < 1e-5
    assert np.abs(np.array([found.network(row) for row in features]) - expected).max() < 1e-5
    assert np.ptp(expected, axis=0).min() > 0.01, "and it is not the same for all"
    assert found.std == pytest.approx(found.ppo.policy.log_std.exp().detach().numpy())


def test_a_first_policy_rarely_ends_an_episode():
    found = learner()
    features = np.random.default_rng(0).normal(0.0, 1.0, (100, N)).astype(np.float32)
    assert found.network(features)[:, -1] == pytest.approx(CONFIG.terminate_bias, abs=0.1)
    assert found.std == pytest.approx(np.exp(CONFIG.log_std))


def test_the_same_settings_give_the_same_policy_and_another_seed_another():
    one = trained().tensors()
    assert same(one, trained().tensors())
    assert not same(one, trained(seed=5).tensors())


def test_learning_goes_on_from_a_checkpoint_bit_for_bit():
    straight = trained(4)
    half = trained(2)
    later = learner()
    later.restore(half.tensors(), timesteps=120)
    assert same(later.tensors(), half.tensors())
    for k in (2, 3):
        later.update(environments(k), k + 1)
    assert same(later.tensors(), straight.tensors())
    assert same(later.network.arrays(), straight.network.arrays())
    assert later.ppo.num_timesteps == straight.ppo.num_timesteps == 240
    assert not same(straight.tensors(), half.tensors())


def test_a_checkpoint_is_a_copy():
    found = trained(1)
    before = found.tensors()
    kept = {k: v.copy() for k, v in before.items()}
    found.update(environments(1), 2)
    assert same(before, kept)


def test_global_random_states_are_left_as_they_were():
    torch.manual_seed(3)
    np.random.seed(3)  # noqa: NPY002
    expected = torch.rand(3).tolist(), np.random.random(3).tolist()  # noqa: NPY002
    torch.manual_seed(3)
    np.random.seed(3)  # noqa: NPY002
    trained(1)
    assert (torch.rand(3).tolist(), np.random.random(3).tolist()) == expected  # noqa: NPY002
    # And neither do they change what is learned.
    a = trained(1).tensors()
    torch.rand(5)
    np.random.random(7)  # noqa: NPY002
    assert same(a, trained(1).tensors())


def test_it_learns_what_pays():
    found = learner(epochs=10, n_steps=200, steps=8000, log_std=-0.7)
    features = np.random.default_rng(1).normal(2.0, 3.0, (300, N)).astype(np.float32)
    wanted = 0.1 * features[:, 0]

    def gap():
        return float(np.abs(found.network(features)[:, 0] - wanted).mean())

    before = gap()
    for k in range(8):
        rows = environments(k, n=200, cut=False)
        for row in rows:
            noise = np.random.default_rng([k, 1]).normal(size=row.actions.shape) * found.std
            row.actions[:] = found.network(row.features) + noise
            row.rewards[:] = -np.abs(row.actions[:, 0] - 0.1 * row.features[:, 0])
        found.update(rows, k + 1)
    assert gap() < 0.7 * before


def test_a_cut_episode_is_worth_what_may_follow():
    """The value beyond a cut counts, at the end of the environment and before."""
    results = []
    for worth in (0.0, 5.0):
        found = learner()
        with torch.no_grad():
            found.ppo.policy.value_net.weight.zero_()
            found.ppo.policy.value_net.bias.fill_(worth)
        rows = environments(0)
        kept = {}

        def keep(found=found, kept=kept):
            kept["returns"] = found.ppo.rollout_buffer.returns.copy()

        found.ppo.train = keep
        for row in rows:
            row.rewards[:] = 0.0
        found.update(rows, 1)
        results.append(kept["returns"])
    assert np.abs(results[0]).max() == 0.0
    # Decision 19 ends an episode for good; 9 and 29 are cut.
    worth = 5.0 * found.config.reward.gamma
    assert results[1][29] == pytest.approx(worth) and results[1][9] == pytest.approx(worth)
    assert results[1][19] == pytest.approx(0.0, abs=1e-6)


def test_it_begins_with_what_was_trained_before():
    network = trained(2).network
    found = learner()
    found.begin_with(network)
    features = np.random.default_rng(0).normal(2.0, 4.0, (50, N)).astype(np.float32)
    assert np.abs(found.network(features) - network(features)).max() < 1e-5
    assert np.abs(torch_policy(found, features) - network(features)).max() < 1e-5
    found.update(environments(7), 1)
    assert not np.array_equal(found.network(features), network(features))


blocks = st.lists(
    arrays.arrays(
        np.float32, st.tuples(st.integers(1, 20), st.just(3)), elements=st.floats(-100, 100, width=32)
    ),
    min_size=1,
    max_size=5,
)


@settings(max_examples=60, deadline=None)
@given(blocks)
def test_running_statistics_are_those_of_all_rows(parts):
    found = Statistics(3)
    for part in parts:
        found.update(part)
    rows = np.concatenate(parts).astype(float)
    assert found.count == len(rows)
    assert found.mean == pytest.approx(rows.mean(axis=0), abs=1e-6)
    assert found.variance == pytest.approx(rows.var(axis=0), rel=1e-6, abs=1e-4)


def test_a_network_is_what_a_file_holds():
    network = trained(1).network
    again = Network.from_arrays(network.arrays())
    features = np.ones(N, np.float32)
    assert np.array_equal(again(features), network(features))
