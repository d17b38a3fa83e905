"""PPO of stable-baselines3, fed with rollouts of several environments."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
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
from bt_tasksim.training.collectors import EnvironmentRollout
from bt_tasksim.training.config import TrainConfig


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
    """A PPO whose rollouts come from several environments.

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
        with _seeded(config.seed):
            self.ppo = PPO(
                "MlpPolicy",
                _Spaces(observation_space, action_space),
                n_steps=config.n_steps * config.n_envs,
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
                    "optimizer_kwargs": {"eps": 1e-5, "fused": True},  # eps as of stable-baselines3's own
                },
            )
            with torch.no_grad():
                self.ppo.policy.action_net.bias[-1] = config.terminate_bias
        self.ppo.rollout_buffer = RolloutBuffer(
            config.n_steps,
            observation_space,
            action_space,
            device="cpu",
            gae_lambda=config.gae_lambda,
            gamma=config.reward.gamma,
            n_envs=config.n_envs,
        )
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

    def update(self, rollouts: list[EnvironmentRollout], iteration: int) -> None:
        """Learn from one rollout.

        Raises:
            InputError: The weights are no finite numbers any more.
        """
        config, policy, buffer = self.config, self.ppo.policy, self.ppo.rollout_buffer
        network = self.network
        n = config.n_steps
        features = np.stack([network.normalise(rollout.features) for rollout in rollouts], axis=1)
        actions = np.stack([rollout.actions for rollout in rollouts], axis=1)
        rewards = np.stack([rollout.rewards for rollout in rollouts], axis=1)
        starts = np.stack([rollout.starts for rollout in rollouts], axis=1)
        with torch.no_grad():
            flat = torch.as_tensor(features.reshape(-1, features.shape[-1]))
            values, log_prob, _ = policy.evaluate_actions(
                flat, torch.as_tensor(actions.reshape(-1, actions.shape[-1]))
            )
            values = values.reshape(n, len(rollouts))
            log_prob = log_prob.reshape(n, len(rollouts))
            last = torch.zeros(len(rollouts))
            ended = np.ones(len(rollouts), bool)
            for k, rollout in enumerate(rollouts):
                if len(rollout.cut):
                    beyond = policy.predict_values(torch.as_tensor(network.normalise(rollout.cut))).flatten()
                    for at, value in zip(rollout.cut_at.tolist(), beyond, strict=True):
                        if at == n - 1:
                            last[k], ended[k] = value, False
                        else:
                            rewards[at, k] += config.reward.gamma * float(value)
        buffer.reset()
        for t in range(n):
            buffer.add(features[t], actions[t], rewards[t], starts[t], values[t], log_prob[t])
        buffer.compute_returns_and_advantage(last_values=last, dones=ended)
        self.ppo.num_timesteps += config.rollout
        self.ppo._update_current_progress_remaining(iteration, max(config.rollouts, 1))
        with _seeded(config.seed, iteration + 1):
            try:
                self.ppo.train()
            except ValueError as error:  # torch refuses a distribution of NaN
                raise _diverged(iteration) from error
        if not all(bool(torch.isfinite(values).all()) for values in policy.state_dict().values()):
            raise _diverged(iteration)
        left = min(1.0, 2.0 - 2.0 * iteration / max(config.rollouts, 1))
        bound = config.final_log_std + left * (config.log_std - config.final_log_std)
        with torch.no_grad():
            policy.log_std.clamp_(max=max(bound, config.final_log_std))
        self.statistics.update(np.concatenate([rollout.features for rollout in rollouts]))

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
