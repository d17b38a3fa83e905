"""ManiSkill's PickCube-v1 to measure against: state observations, ``pd_joint_delta_pos``, CPU.

`Peer` is a process of its own, which keeps Vulkan, SAPIEN and torch's threads away from ours. It works only
while it is asked.
"""

from __future__ import annotations

import multiprocessing
import time
from typing import Any

import numpy as np

from bt_tasksim.engines.physx import start_physx
from bt_tasksim.engines.vulkan import use_software_driver

EPISODE = 50
"""Steps of an episode, PickCube-v1's own limit."""


class Peer:
    """Measures PickCube-v1.

    Attributes:
        missing: Why it does not start here; empty when it does.
    """

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,))
        self._process.start()
        theirs.close()
        self.missing: str = self._pipe.recv()

    def steps(self, processes: int, n: int) -> float:
        """Steps per second of ``n`` random steps, whole episodes with their resets."""
        return self._ask("steps", processes, n)

    def bare(self, n: int) -> float:
        """Steps per second of ``n`` random steps in the environment itself, in no wrapper."""
        return self._ask("bare", 0, n)

    def learn(self, processes: int, rollouts: int, settings: dict[str, Any]) -> float:
        """Transitions per second of stable-baselines3's PPO, rollouts and updates."""
        return self._ask("learn", processes, rollouts, settings)

    def close(self) -> None:
        """End the process."""
        self._pipe.close()
        self._process.join(timeout=10.0)
        if self._process.is_alive():
            self._process.kill()

    def _ask(self, *what: Any) -> float:
        self._pipe.send(what)
        kind, value = self._pipe.recv()
        if kind == "error":
            raise RuntimeError(value)
        return float(value)


def environment() -> Any:
    """The environment itself, in torch, a batch of one."""
    use_software_driver()
    import gymnasium
    import mani_skill.envs  # noqa: F401

    start_physx()  # a process has one: with the same tolerances, whoever comes first
    return gymnasium.make(
        "PickCube-v1", obs_mode="state", control_mode="pd_joint_delta_pos", num_envs=1, sim_backend="cpu"
    )


def rates(env: Any, steps: int) -> tuple[float, float]:
    """Steps per second of whole episodes of an `environment` with their resets, and of the steps alone."""
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (steps, *env.action_space.shape)).astype(np.float32)
    resetting, started = 0.0, time.perf_counter()
    for k, action in enumerate(actions):
        if k % EPISODE == 0:
            begun = time.perf_counter()
            env.reset(seed=k)
            resetting += time.perf_counter() - begun
        env.step(action)
    total = time.perf_counter() - started
    return steps / total, steps / (total - resetting)


def make() -> Any:
    """One environment as gymnasium knows them, in NumPy."""
    import torch
    from mani_skill.utils.wrappers.gymnasium import CPUGymWrapper

    torch.set_num_threads(1)
    return CPUGymWrapper(environment())


def _serve(pipe: Any) -> None:
    try:
        envs: dict[int, Any] = {1: _vector(1)}  # by processes, the bare environment as of none
        pipe.send("")
    except Exception as error:  # any reason it does not start here
        pipe.send(f"{type(error).__name__}: {error}")
        return
    while True:
        try:
            what, processes, *rest = pipe.recv()
        except EOFError:
            break
        try:
            if processes not in envs:
                envs[processes] = _vector(processes) if processes else environment()
            work = {"steps": _steps, "bare": _bare, "learn": _learn}[what]
            pipe.send(("done", work(envs[processes], *rest)))
        except Exception as error:
            pipe.send(("error", f"{type(error).__name__}: {error}"))
    for env in envs.values():
        env.close()


def _vector(processes: int) -> Any:
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

    if processes == 1:
        return DummyVecEnv([make])
    return SubprocVecEnv([make] * processes, start_method="spawn")


def _bare(env: Any, n: int) -> float:
    return rates(env, n)[0]


def _steps(env: Any, n: int) -> float:
    rng = np.random.default_rng(0)
    count = n // env.num_envs
    actions = rng.uniform(-1, 1, (count, env.num_envs, *env.action_space.shape)).astype(np.float32)
    env.reset()
    started = time.perf_counter()
    for action in actions:
        env.step(action)  # resets by itself at an episode's end
    return float(count * env.num_envs / (time.perf_counter() - started))


def _learn(env: Any, rollouts: int, settings: dict[str, Any]) -> float:
    import torch
    from stable_baselines3 import PPO

    torch.set_num_threads(1)
    rollout, hidden = settings["rollout"], settings["hidden"]
    learner = PPO(
        "MlpPolicy",
        env,
        n_steps=rollout // env.num_envs,
        batch_size=settings["minibatch"],
        n_epochs=settings["epochs"],
        learning_rate=settings["learning_rate"],
        gamma=settings["gamma"],
        gae_lambda=settings["gae_lambda"],
        clip_range=settings["clip"],
        ent_coef=settings["entropy"],
        device="cpu",
        policy_kwargs={"net_arch": {"pi": hidden, "vf": hidden}, "activation_fn": torch.nn.Tanh},
    )
    env.reset()
    started = time.perf_counter()
    learner.learn(rollouts * rollout)
    return rollouts * rollout / (time.perf_counter() - started)
