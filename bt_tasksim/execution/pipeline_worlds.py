"""Worlds of one: what has no form for many worlds, behind the interface of those that have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bt_tasksim.concept.context import Written, one_world
from bt_tasksim.core.bundles import mapped
from bt_tasksim.core.errors import BtTasksimError, UnreachableError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Command, Hidden, Observation
from bt_tasksim.engines.pipeline import EnginePipeline
from bt_tasksim.execution.pipelines import EngineOptions, build_pipeline
from bt_tasksim.execution.worlds import BatchWorlds, Unreached, Worlds, why_alone
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.scene import WorldSource


class PipelineWorlds(Worlds):
    """The one world of an engine pipeline.

    Args:
        robot: The robot.
        pipeline: The pipeline; it is closed with the worlds.
    """

    def __init__(self, robot: RobotDescription, pipeline: EnginePipeline) -> None:
        self.count, self.pipeline, self.real = 1, pipeline, pipeline.real
        self._robot, self._tips = robot, [tip.name for tip in robot.tips]
        self._seen: Observation | None = None
        self._error: BtTasksimError | None = None

    def source(self, scene: WorldSource) -> WorldSource:
        """See `Worlds.source`: the physics engine may bring its own world."""
        return self.pipeline.worlds(scene)

    def reset(self, rows: Array, configurations: Sequence[ActorConfiguration]) -> None:
        """See `Worlds.reset`."""
        for configuration in configurations:
            model = configuration.world_model(self._tips, self._robot.opening)
            self._error = None
            try:
                self._seen = self.pipeline.reset(configuration, model)
            except BtTasksimError as error:
                self._error = error

    def errors(self, rows: Array) -> dict[int, BtTasksimError]:
        """See `Worlds.errors`."""
        return {} if self._error is None else dict.fromkeys(rows.tolist(), self._error)

    def observe(self, rows: Array) -> Observation:
        """See `Worlds.observe`."""
        assert self._seen is not None, "reset() comes before"
        self.observation = one_world(self._seen)
        return self.observation

    def step(self, tool: Array | None, hand: Array | None, rows: Array) -> list[Unreached]:
        """See `Worlds.step`."""
        unreached: list[Unreached] = []
        try:
            try:
                self._seen = self.pipeline.step(Written(tool, hand).of_world(0))
            except UnreachableError as error:
                unreached.append(Unreached(0, error))
                self._seen = self.pipeline.step(Command())
        except BtTasksimError as error:
            self._error = error
        return unreached

    def hidden(self, rows: Array | None = None) -> Hidden | None:
        """See `Worlds.hidden`."""
        found: Hidden | None = mapped(lambda values: np.asarray(values)[None], self.pipeline.hidden())
        return found

    def picture(self, camera: str) -> Array:
        """See `Worlds.picture`."""
        return self.pipeline.render(camera).colour

    def close(self) -> None:
        """See `Worlds.close`."""
        self.pipeline.close()


def worlds_for(robot: RobotDescription, options: EngineOptions, count: int, threads: int) -> Worlds:
    """Worlds with these engines: in a batch, or a single one where they have no form for many.

    Args:
        robot: The robot.
        options: The engines.
        count: How many worlds.
        threads: How many threads step them, in a batch.

    Raises:
        InputError: An engine is none for this robot; or there are to be several worlds, and they have no form
            for that, see `why_alone`, or do not fit into memory.
        MachineError: An engine cannot start.
    """
    if count == 1 and why_alone(options):
        return PipelineWorlds(robot, build_pipeline(robot, options))
    return BatchWorlds(robot, options, count, threads)
