"""One environment of ManiSkill: opened, reset by seed, stepped with joint targets, and asked for success."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from typing import Any

import numpy as np

from bt_tasksim.core.errors import InputError, MachineError, nearest
from bt_tasksim.core.plain import shown
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.maniskill.schema import EnvironmentFile
from bt_tasksim.engines.vulkan import use_software_driver

CONTROL_MODE = "pd_joint_pos"
"""ManiSkill's controller that takes joint positions."""
NO_RENDERER = ("rendering device", "vk::", "vulkan")
"""What is in the errors of machines without a render device."""


class Environment:
    """An environment of ManiSkill with one world, on the CPU.

    Args:
        file: What is in it.
        robot: ManiSkill's name of the robot.
        drawn: Pictures will be wanted.

    Attributes:
        base: ManiSkill's own environment, a ``BaseEnv``.

    Raises:
        InputError: There is no such environment, or it is none for this.
        MachineError: ManiSkill is not installed, the machine has no Vulkan device, or assets are missing.
    """

    def __init__(self, file: EnvironmentFile, robot: str, drawn: bool = False) -> None:
        self.file = file
        self._env = _open(file, robot, drawn)
        self.base: Any = self._env.unwrapped
        self._fresh: int | None = None
        if "success" not in self.base.evaluate():
            self.close()
            raise InputError(f"ManiSkill's '{file.environment}' does not say what success is")

    @property
    def frequencies(self) -> tuple[int, int]:
        """Hz of physics and of control."""
        return int(self.base.sim_freq), int(self.base.control_freq)

    def reset(self, seed: int) -> None:
        """A world; the same seed gives the same one.

        Args:
            seed: From 0 to 2^32 - 1.
        """
        if self._fresh != seed:
            with _quiet():
                self._env.reset(seed=seed, options={"reconfigure": self.file.rebuild})
            self._fresh = seed

    def step(self, action: Array) -> None:
        """One control period.

        Args:
            action: As the controller takes it ``(n,)``.
        """
        self._fresh = None
        self._env.step(action)

    def evaluate(self) -> dict[str, Any]:
        """What the environment says of its present state, in plain values."""
        return {name: _plain(value) for name, value in self.base.evaluate().items()}

    def actor(self, name: str) -> Any:
        """An actor by its name in the scene, or in the environment's attributes.

        Raises:
            InputError: There is none.
        """
        actors = self.base.scene.actors
        found = actors.get(name) or getattr(self.base, name, None)
        if found is None or not hasattr(found, "px_body_type"):
            raise InputError(
                f"ManiSkill's '{self.file.environment}' has no actor '{shown(name)}'{nearest(name, actors)}"
            )
        return found

    def close(self) -> None:
        """Let go of it."""
        self._env.close()


def _open(file: EnvironmentFile, robot: str, drawn: bool) -> Any:
    use_software_driver()
    try:
        import gymnasium
        import mani_skill.envs  # noqa: F401  # its environments announce themselves
        from mani_skill.utils.registration import REGISTERED_ENVS
    except ImportError as error:
        raise MachineError(
            f"ManiSkill's environments cannot start: {error}; "
            "install the simulation extra: pip install 'bt-tasksim[sim]'"
        ) from error
    name = file.environment
    try:
        spec = gymnasium.spec(name)
    except ModuleNotFoundError as error:
        raise InputError(f"no module for the environment '{shown(name)}': {error}") from error
    except gymnasium.error.Error as error:
        known = nearest(name, REGISTERED_ENVS)
        raise InputError(f"ManiSkill has no environment '{shown(name)}'{known}") from error
    if spec.id not in REGISTERED_ENVS:
        raise InputError(f"'{shown(name)}' is an environment, but none of ManiSkill's")
    _check_assets(spec.id, REGISTERED_ENVS[spec.id])
    with _quiet():
        try:
            return gymnasium.make(
                name,
                max_episode_steps=file.max_episode_steps,
                num_envs=1,
                obs_mode="none",
                reward_mode="none",
                control_mode=CONTROL_MODE,
                sim_backend="physx_cpu",
                render_backend="cpu" if drawn else "none",
                robot_uids=robot,
            )
        except RuntimeError as error:
            if any(word in str(error).lower() for word in NO_RENDERER):
                raise MachineError(
                    "ManiSkill's environments do not start without a Vulkan device, and SAPIEN finds none: "
                    "'make setup' fetches a software driver, or install Mesa's from 24.3 on"
                ) from error
            raise InputError(f"ManiSkill's '{shown(name)}' does not start with '{robot}': {error}") from error
        except (AssertionError, AttributeError, KeyError, NotImplementedError, TypeError) as error:
            raise InputError(
                f"ManiSkill's '{shown(name)}' does not start with the robot '{shown(robot)}' and "
                f"{CONTROL_MODE}: {type(error).__name__}: {error}"
            ) from error


def _check_assets(name: str, spec: Any) -> None:
    """Refuse an environment that would ask in the terminal whether it may download what it needs."""
    from mani_skill.utils import assets

    wanted: list[str] = []
    for group in spec.asset_download_ids or ():
        inner = (
            assets.expand_data_group_into_individual_data_source_ids(group)
            if group in assets.DATA_GROUPS
            else [group]
        )
        wanted += [source for source in inner if not assets.is_data_source_downloaded(source)]
    if wanted:
        raise InputError(
            f"ManiSkill's '{name}' needs assets that are not on this machine: fetch them with "
            f"'python -m mani_skill.utils.download_asset {name}'"
        )


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Without what ManiSkill says about machines that have no GPU."""
    log = logging.getLogger("mani_skill ")  # with a blank: so ManiSkill calls it
    before = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(before)


def _plain(value: Any) -> Any:
    """One world's value: true or false, or a number; anything else as it is."""
    array = np.asarray(value.cpu() if hasattr(value, "cpu") else value)
    if array.size != 1 or array.dtype.kind not in "biuf":
        return value
    return array.reshape(()).item()
