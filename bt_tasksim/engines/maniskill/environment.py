"""One environment of ManiSkill: opened, reset by seed, stepped with joint targets, and asked for success."""

from __future__ import annotations

import contextlib
import logging
import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from bt_tasksim.core.errors import InputError, MachineError, nearest
from bt_tasksim.core.plain import shown
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.maniskill.schema import EnvironmentFile
from bt_tasksim.engines.physx import start_physx
from bt_tasksim.engines.vulkan import render_device, use_software_driver

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
        try:
            self.evaluate()
        except BaseException:
            self.close()
            raise

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
        """What the environment says of its present state, in plain values; ``success`` is true or false.

        Raises:
            InputError: It does not say what success is, or not with one truth value.
        """
        said = self.base.evaluate()
        if not isinstance(said, Mapping) or "success" not in said:
            raise InputError(f"ManiSkill's '{self.file.environment}' does not say what success is")
        found = {name: _plain(value) for name, value in said.items()}
        success = found["success"]
        if not isinstance(success, bool | int | float) or success not in (0, 1):
            raise InputError(
                f"ManiSkill's '{self.file.environment}' should say success with one truth value for a world "
                f"when it is evaluated, found {shown(repr(said['success']))}"
            )
        return {**found, "success": bool(success)}

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
        from mani_skill.agents.registration import REGISTERED_AGENTS
        from mani_skill.utils.registration import REGISTERED_ENVS
    except ImportError as error:
        raise MachineError(
            f"ManiSkill's environments cannot start: {error}; "
            "install the simulation extra: pip install 'bt-tasksim[sim]'"
        ) from error
    module, _, name = file.environment.rpartition(":")
    if module and module not in sys.modules and _registered_by(REGISTERED_ENVS.get(name)) != module:
        raise InputError(
            f"the environment '{shown(name)}' is of the module '{shown(module)}', and a file runs no code: "
            f"load it yourself with --plugin {shown(module)}, or import it in the tree's file"
        )
    try:
        spec = gymnasium.spec(name)
    except gymnasium.error.Error as error:
        known = nearest(name, REGISTERED_ENVS)
        raise InputError(
            f"ManiSkill has no environment '{shown(name)}'{known}; one of your own comes with --plugin"
        ) from error
    if spec.id not in REGISTERED_ENVS:
        raise InputError(f"'{shown(name)}' is an environment, but none of ManiSkill's")
    _check_assets(spec.id, REGISTERED_ENVS[spec.id].asset_download_ids)
    if robot in REGISTERED_AGENTS:
        _check_assets(robot, REGISTERED_AGENTS[robot].asset_download_ids)
    start_physx()
    with _quiet():
        try:
            return gymnasium.make(
                spec,
                max_episode_steps=file.max_episode_steps,
                num_envs=1,
                obs_mode="none",
                reward_mode="none",
                control_mode=CONTROL_MODE,
                sim_backend="physx_cpu",
                render_backend=render_device() if drawn else "none",
                robot_uids=robot,
            )
        except RuntimeError as error:
            if any(word in str(error).lower() for word in NO_RENDERER):
                raise MachineError(
                    "ManiSkill's environments do not start without a Vulkan device, and SAPIEN finds none: "
                    "'make setup' fetches a software driver, or install Mesa's from 24.3 on"
                ) from error
            raise InputError(f"ManiSkill's '{shown(name)}' does not start with '{robot}': {error}") from error
        except EOFError as error:
            raise InputError(
                f"ManiSkill's '{shown(name)}' asks whether it may download what it needs: start it once by "
                "itself, and answer"
            ) from error
        except (AssertionError, AttributeError, KeyError, NotImplementedError, TypeError) as error:
            raise InputError(
                f"ManiSkill's '{shown(name)}' does not start with the robot '{shown(robot)}' and "
                f"{CONTROL_MODE}: {type(error).__name__}: {error}"
            ) from error


def _registered_by(spec: Any) -> str:
    """Name of the module or file of an environment's class."""
    module: str = getattr(getattr(spec, "cls", None), "__module__", "")
    return module.removeprefix("_plugin_").removeprefix("_tree_")


def _check_assets(name: str, groups: Iterable[str] | None) -> None:
    """Refuse what would ask in the terminal whether it may download what it needs."""
    from mani_skill.utils import assets

    wanted: list[str] = []
    for group in groups or ():
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
    try:
        array = np.asarray(value.cpu() if hasattr(value, "cpu") else value)
    except ValueError:  # ragged
        return value
    if array.size != 1 or array.dtype.kind not in "biuf":
        return value
    return array.reshape(()).item()
