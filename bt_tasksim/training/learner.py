"""PPO of stable-baselines3, fed with whole episodes."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.policy.network import Network
from bt_tasksim.training.collectors import EpisodeRollout
from bt_tasksim.training.config import TrainConfig

_NOTHING = gymnasium.spaces.Box(0.0, 1.0, (1,), np.float32)
"""Room for what a buffer need not hold."""


class _Spaces(gymnasium.Env[Array, Array]):
    """Tells stable-baselines3 the spaces; the episodes run elsewhere."""

    def __init__(self, observation_space: Any, action_space: Any) -> None:
        self.observation_space, self.action_space = observation_space, action_space

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        return np.zeros(self.observation_space.shape or (), np.float32), {}

    def step(self, action: Any) -> Any:
        raise RuntimeError("episodes are collected by worker processes")


class Statistics:
    """Running mean and variance of features.

    Source: T. Chan, G. Golub, R. LeVeque, "Updating formulae and a pairwise algorithm for computing sample
    variances", 1979.
    """

    def __init__(self, n: int) -> None:
        self.mean, self.variance, self.count = np.zeros(n), np.ones(n), 0.0

    def update(self, rows: Array) -> None:
        """Take in rows ``(k, n)``."""
        k, mean, variance = len(rows), rows.mean(axis=0, dtype=float), rows.var(axis=0, dtype=float)
        if self.count == 0.0:
            self.mean, self.variance, self.count = mean, variance, float(k)
            return
        gap, total = mean - self.mean, self.count + k
        spread = self.variance * self.count + variance * k + gap * gap * self.count * k / total
        self.mean = self.mean + gap * (k / total)
        self.variance, self.count = spread / total, total


class Learner:
    """A PPO whose rollouts are whole episodes, however many decisions each has.

    Args:
        observation_space: Box ``(n,)``.
        action_space: Box ``(m,)``.
        config: The settings.
        board: Folder for TensorBoard; None: nothing is logged.
    """

    def __init__(
        self, observation_space: Any, action_space: Any, config: TrainConfig, board: Path | None = None
    ) -> None:
        self.config = config
        self._spaces = _Spaces(observation_space, action_space)
        with _seeded(config.seed):
            self.ppo = PPO(
                "MlpPolicy",
                self._spaces,
                n_steps=config.rollout,
                batch_size=min(config.minibatch, config.rollout),
                n_epochs=config.epochs,
                learning_rate=lambda left: (
                    config.final_learning_rate + left * (config.learning_rate - config.final_learning_rate)
                ),
                gamma=config.reward.gamma,
                gae_lambda=config.gae_lambda,
                clip_range=config.clip,
                ent_coef=config.entropy,
                device="cpu",
                policy_kwargs={
                    "net_arch": {"pi": list(config.hidden), "vf": list(config.hidden)},
                    "activation_fn": torch.nn.Tanh,
                    "log_std_init": config.log_std,
                },
            )
            with torch.no_grad():
                self.ppo.policy.action_net.bias[-1] = config.terminate_bias
        outputs = [TensorBoardOutputFormat(str(board))] if board is not None else []
        self.logger = Logger(None if board is None else str(board), outputs)
        self.ppo.set_logger(self.logger)
        self.statistics = Statistics(observation_space.shape[0])

    @property
    def network(self) -> Network:
        """The present policy without its exploration."""
        policy = self.ppo.policy
        hidden = [m for m in policy.mlp_extractor.policy_net if isinstance(m, torch.nn.Linear)]
        layers = [(_numpy(m.weight), _numpy(m.bias)) for m in (*hidden, policy.action_net)]
        return Network(self.statistics.mean, np.sqrt(self.statistics.variance), layers)

    @property
    def decisive(self) -> Network:
        """The present policy as it decides for good, see `bt_tasksim.policy.policy.done_share`."""
        network = self.network
        return Network(network.mean, network.std, network.layers, float(self.std[-1]))

    @property
    def std(self) -> Array:
        """Standard deviations ``(m,)`` of the actions."""
        return np.exp(_numpy(self.ppo.policy.log_std))

    def update(self, episodes: Sequence[EpisodeRollout], iteration: int, left: float) -> None:
        """Learn from one rollout.

        Args:
            episodes: Its episodes.
            iteration: Its number, from 1.
            left: Share of the training that is left after it.

        Raises:
            InputError: The weights are no finite numbers any more.
        """
        config, policy = self.config, self.ppo.policy
        buffer = self._rollout(episodes)
        n = buffer.buffer_size
        self.ppo.rollout_buffer = buffer
        self.ppo.batch_size = -(-n // max(1, round(n / config.minibatch)))  # alike, without a small rest
        self.ppo.num_timesteps += n
        self.ppo._current_progress_remaining = left
        with _seeded(config.seed, iteration + 1):
            try:
                self.ppo.train()
            except ValueError as error:  # torch refuses a distribution of NaN
                raise _diverged(iteration) from error
        if not all(bool(torch.isfinite(values).all()) for values in policy.state_dict().values()):
            raise _diverged(iteration)
        bound = config.final_log_std + min(1.0, 2.0 * left) * (config.log_std - config.final_log_std)
        with torch.no_grad():
            policy.log_std.clamp_(max=max(bound, config.final_log_std))
        self.statistics.update(np.concatenate([episode.features for episode in episodes]))

    def _rollout(self, episodes: Sequence[EpisodeRollout]) -> RolloutBuffer:
        """Episodes as one row of decisions ``(n, 1)`` with values, advantages and returns."""
        config, policy, spaces = self.config, self.ppo.policy, self._spaces
        about = {"gae_lambda": config.gae_lambda, "gamma": config.reward.gamma, "device": "cpu"}
        lengths = np.array([len(episode.rewards) for episode in episodes])
        rows = RolloutBuffer(int(lengths.sum()), spaces.observation_space, spaces.action_space, **about)
        network = self.network
        features = network.normalise(np.concatenate([episode.features for episode in episodes]))
        rows.observations[:, 0] = features
        rows.actions[:, 0] = np.concatenate([episode.actions for episode in episodes])
        rewards = np.concatenate([episode.rewards for episode in episodes])
        cut = {k: episode.cut for k, episode in enumerate(episodes) if episode.cut is not None}
        with torch.no_grad():
            values, log_prob, _ = policy.evaluate_actions(
                torch.as_tensor(rows.observations[:, 0]), torch.as_tensor(rows.actions[:, 0])
            )
            if cut:
                beyond = network.normalise(np.stack(list(cut.values())))
                worth = policy.predict_values(torch.as_tensor(beyond)).flatten().numpy()
                rewards[np.cumsum(lengths)[list(cut)] - 1] += config.reward.gamma * worth
        # Side by side, an episode a column, the law of advantages is stable-baselines3's own.
        apart = RolloutBuffer(int(lengths.max()), _NOTHING, _NOTHING, n_envs=len(episodes), **about)
        steps = np.arange(lengths.max())
        within = steps[:, None] < lengths
        apart.rewards.T[within.T] = rewards
        apart.values.T[within.T] = values.flatten().numpy()
        apart.episode_starts[:] = ~within
        apart.compute_returns_and_advantage(torch.zeros(len(episodes)), np.ones(len(episodes), bool))
        rows.rewards[:, 0], rows.values[:, 0] = rewards, values.flatten().numpy()
        rows.log_probs[:, 0] = log_prob.numpy()
        rows.advantages[:, 0], rows.returns[:, 0] = apart.advantages.T[within.T], apart.returns.T[within.T]
        rows.full = True
        return rows

    # ---- checkpoints ------------------------------------------------------------------------------------

    def tensors(self) -> dict[str, Array]:
        """Everything that a later `restore` needs, by name."""
        out = {f"policy/{k}": _numpy(v) for k, v in self.ppo.policy.state_dict().items()}
        state = self.ppo.policy.optimizer.state_dict()["state"]
        for index, entries in state.items():
            for name, value in entries.items():
                out[f"optimizer/{index}/{name}"] = np.atleast_1d(_numpy(torch.as_tensor(value)))
        statistics = self.statistics
        out["statistics/mean"], out["statistics/variance"] = statistics.mean, statistics.variance
        out["statistics/count"] = np.array([statistics.count])
        return out

    def restore(self, tensors: dict[str, Array], timesteps: int) -> None:
        """Go on where `tensors` was taken."""
        weights = {k.removeprefix("policy/"): v for k, v in tensors.items() if k.startswith("policy/")}
        self.ppo.policy.load_state_dict({k: torch.as_tensor(v) for k, v in weights.items()})
        optimizer = self.ppo.policy.optimizer
        state = optimizer.state_dict()
        for key, value in tensors.items():
            if key.startswith("optimizer/"):
                _, index, name = key.split("/")
                entry = torch.as_tensor(value)
                state["state"].setdefault(int(index), {})[name] = entry[0] if name == "step" else entry
        optimizer.load_state_dict(state)
        self.statistics.mean = tensors["statistics/mean"].astype(float)
        self.statistics.variance = tensors["statistics/variance"].astype(float)
        self.statistics.count = float(tensors["statistics/count"][0])
        self.ppo.num_timesteps = timesteps

    def begin_with(self, network: Network) -> None:
        """Take over a trained network, to go on learning from it."""
        policy = self.ppo.policy
        hidden = [m for m in policy.mlp_extractor.policy_net if isinstance(m, torch.nn.Linear)]
        with torch.no_grad():
            for module, (w, b) in zip((*hidden, policy.action_net), network.layers, strict=True):
                module.weight.copy_(torch.as_tensor(w))
                module.bias.copy_(torch.as_tensor(b))
        self.statistics.mean = network.mean.astype(float)
        self.statistics.variance = network.std.astype(float) ** 2
        self.statistics.count = float(self.config.rollout * 50)


def _diverged(iteration: int) -> InputError:
    return InputError(
        f"the training diverged in rollout {iteration}: the network's weights are no finite numbers any "
        "more; take a smaller learning rate, and look at the rewards"
    )


def _numpy(tensor: Any) -> Array:
    found: Array = tensor.detach().cpu().numpy().copy()
    return found


@contextlib.contextmanager
def _seeded(*seed: int) -> Iterator[None]:
    """Seeds torch's and NumPy's own generators inside the block, and leaves them as they were."""
    before = np.random.get_state()  # noqa: NPY002  # stable-baselines3 shuffles with it
    number = int(np.random.SeedSequence(seed).generate_state(1)[0])
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(number)
        np.random.seed(number)  # noqa: NPY002
        try:
            yield
        finally:
            np.random.set_state(before)  # noqa: NPY002
