"""Episodes in many worlds as a vector environment of stable-baselines3, which is not one of gymnasium's."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from bt_tasksim.core.poses import Array
from bt_tasksim.training.vector_env import EpisodeVectorEnv


class SB3VectorEnv(VecEnv):  # type: ignore[misc]  # taken as untyped
    """An `EpisodeVectorEnv` for the algorithms of stable-baselines3; `VecMonitor` and its like go around it.

    Of an episode's last step ``infos`` has what an `EpisodeEnv` says then (``is_success`` among it), and
    ``terminal_observation`` and ``TimeLimit.truncated``. There is one batch of worlds: an attribute that is
    asked for is the batch's own, the same for all of them.

    Args:
        envs: The worlds; they are closed with it.
    """

    def __init__(self, envs: EpisodeVectorEnv) -> None:
        self.envs = envs
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> Array:
        """Begin an episode in every world: features ``(N, n)``, float32.

        Raises:
            InputError: See `EpisodeVectorEnv.reset`.
        """
        rows = np.arange(self.num_envs)
        self.envs.begin(rows, self._seeds)
        self._reset_seeds()
        self._reset_options()
        ready = self.envs.wait(rows)
        self.reset_infos = ready.infos
        return ready.features

    def step_async(self, actions: Array) -> None:
        """Give every world its action ``(N, actions + 1)``.

        Raises:
            InputError: See `EpisodeVectorEnv.send`.
        """
        self.envs.send(np.arange(self.num_envs), actions)

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Go on to the next decision in every world.

        Returns:
            Features ``(N, n)`` and rewards ``(N,)``, float32; boolean ``(N,)``, an episode ended; infos.
        """
        ready = self.envs.wait(np.arange(self.num_envs))
        infos = [_as_of_sb3(info, bool(cut)) for info, cut in zip(ready.infos, ready.truncated, strict=True)]
        rewards = ready.rewards.astype(np.float32)
        return ready.features, rewards, ready.terminated | ready.truncated, infos

    def close(self) -> None:
        """Let go of engines; the tree can be run again."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The batch's own attribute, once for each world that is asked."""
        return [getattr(self.envs, attr_name)] * self._many(indices)

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Not possible.

        Raises:
            NotImplementedError: Always.
        """
        raise NotImplementedError("worlds of one batch have no attributes of their own")

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Not possible.

        Raises:
            NotImplementedError: Always.
        """
        raise NotImplementedError("worlds of one batch have no methods of their own: call those of .envs")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No world has a wrapper of its own."""
        return [False] * self._many(indices)

    def _many(self, indices: Any) -> int:
        if indices is None:
            return self.envs.num_envs
        return len(list(indices)) if isinstance(indices, Iterable) else 1


def _as_of_sb3(info: dict[str, Any], truncated: bool) -> dict[str, Any]:
    """What is said of a world, in the words of stable-baselines3."""
    if "final_info" not in info:
        return info
    return {
        **info["final_info"],
        "terminal_observation": info["final_obs"],
        "TimeLimit.truncated": truncated,
    }
