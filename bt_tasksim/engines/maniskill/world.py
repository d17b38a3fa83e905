"""Where the worlds of an environment come from: the environment itself, by seed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.plain import shown
from bt_tasksim.core.resources import is_file
from bt_tasksim.engines.maniskill.files import load_environment_file
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import STREAMS, ActorConfiguration, check_seed, generator
from bt_tasksim.scene.scene import CurriculumStage

LARGEST_SEED = 2**32 - 1
"""ManiSkill's seeds have 32 bits."""
Draw = Callable[[int, str], ActorConfiguration]
"""A world by seed and stream."""


class EnvironmentWorld:
    """The world that an environment of ManiSkill brings, as trees and runs see it.

    Args:
        environment: Id of the environment or path of its file.
        robot: ManiSkill's name of its robot, ours of it, or our robot's file; None for the file's first.
        draw: Draws the worlds; None where there is no simulation yet, and only names are asked for.

    Raises:
        InputError: There is no such file, or the environment has no such robot.
    """

    def __init__(self, environment: str, robot: str | None = None, draw: Draw | None = None) -> None:
        self.environment, self._draw = environment, draw
        self.file = load_environment_file(environment)
        self.agent = _agent(self.file.environment, self.file.robots, robot)
        self.robot = robot if robot is not None and is_file(robot) else self.file.robots[self.agent]

    @property
    def name(self) -> str:
        """The environment's id."""
        return self.file.environment

    @property
    def stages(self) -> Sequence[CurriculumStage]:
        """None: an environment knows no curriculum."""
        return ()

    @property
    def object_names(self) -> Collection[str]:
        """Names of the objects in its file."""
        return self.file.objects.keys()

    @property
    def place_names(self) -> Collection[str]:
        """Names of the places in its file."""
        return self.file.places.keys()

    def content(self) -> Mapping[str, Any]:
        """What its file says, in plain data: where that is the same, so are its worlds."""
        return self.file.model_dump(mode="json")

    def with_robot(self, robot: str) -> EnvironmentWorld:
        """The same with another robot.

        Raises:
            InputError: The environment's file does not name it.
        """
        return EnvironmentWorld(self.environment, robot)

    def drawn_by(self, draw: Draw) -> EnvironmentWorld:
        """The same, with a simulation that draws its worlds."""
        return EnvironmentWorld(self.environment, self.robot, draw)

    def sample(self, seed: int, stream: str = "evaluation", stage: int | None = None) -> ActorConfiguration:
        """The world of a seed.

        Args:
            seed: In the stream of evaluations that of ManiSkill's own ``reset``, from 0 to `LARGEST_SEED`.
            stream: One of `STREAMS`; training and evaluation never share draws.
            stage: There is none.

        Raises:
            InputError: The seed is too large, a stage is asked for, or there is no simulation.
        """
        check_seed(seed)
        if stage is not None:
            raise InputError(f"'{self.name}' has no stages")
        if self._draw is None:
            raise InputError(f"'{self.name}' draws worlds in its own simulation alone: give it to a Runner")
        return self._draw(seed, stream)


def environment_seed(seed: int, stream: str) -> int:
    """The seed for ManiSkill's ``reset``: the same for evaluations, from 2^31 on for all other streams.

    Raises:
        InputError: It is too large.
    """
    if STREAMS[stream] == STREAMS["evaluation"]:
        if seed > LARGEST_SEED:
            raise InputError(f"ManiSkill's seeds go from 0 to {LARGEST_SEED}, found {seed}")
        return seed
    return int(generator(seed, stream, "maniskill").integers(2**31, 2**32))


def _agent(environment: str, robots: dict[str, str], robot: str | None) -> str:
    """ManiSkill's name of a robot."""
    if robot is None:
        return next(iter(robots))
    if robot in robots:
        return robot
    wanted = load_robot(robot)
    for theirs, ours in robots.items():
        if load_robot(ours).name == wanted.name:
            return theirs
    raise InputError(
        f"the file of ManiSkill's '{environment}' has no robot '{shown(robot)}'{nearest(robot, robots)}"
    )
