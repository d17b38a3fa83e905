"""Post-process without images: the estimate is the true pose with a stated error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.transfer import Index, spliced
from bt_tasksim.core.world import Observation, WorldModel, WorldState
from bt_tasksim.engines.base import EngineSetup, PostProcessEngine
from bt_tasksim.engines.images import Image
from bt_tasksim.engines.perception.features import (
    BatchObservations,
    alone,
    widened,
    with_axis,
)
from bt_tasksim.engines.perception.noise import NoiseModel, noise_model
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration


@register("engine/postprocess", "state")
class StatePostProcess(PostProcessEngine):
    """A post-process engine for fast training and evaluation in simulation.

    Args:
        robot: The robot.
        noise: Error of the estimate, where the world as drawn does not say otherwise.
    """

    def __init__(self, robot: RobotDescription, noise: NoiseModel) -> None:
        self.robot = robot
        self.noise = noise
        self._batch = BatchState(robot, 1, noise)

    @classmethod
    def create(cls, robot: RobotDescription, setup: EngineSetup) -> Self:
        """See `Engine.create`; what tracks a real robot's objects has errors of its own."""
        return cls(robot, noise_model("none" if setup.real else setup.noise))

    @classmethod
    def label(cls, setup: EngineSetup) -> str:
        """See `Engine.label`: with the error of its estimates."""
        return "tracked" if setup.real else f"state, noise {setup.noise}"

    def reset(self, configuration: ActorConfiguration, model: WorldModel) -> None:
        """See `PostProcessEngine.reset`."""
        self._batch.reset([0], [configuration])

    def observe(self, state: WorldState, images: Mapping[str, Image]) -> Observation:
        """See `PostProcessEngine.observe`."""
        return alone(self._batch.observe(with_axis(state)))


class BatchState:
    """Observations of ``n`` worlds whose estimates are the true poses with stated errors.

    Args:
        robot: The robot.
        n: Number of worlds.
        noise: Error of the estimates, where a world as drawn does not say otherwise.
    """

    def __init__(self, robot: RobotDescription, n: int, noise: NoiseModel) -> None:
        self._noise, self.n = noise, n
        self._errors: list[Array] = [np.empty((0, 7))] * n
        self._builder = BatchObservations(robot, n)
        self._local: Array | None = None
        self._unseen = np.ones(n, bool)

    def reset(self, rows: Sequence[int] | np.ndarray, configurations: Sequence[ActorConfiguration]) -> None:
        """Worlds begin new episodes, each with errors of its own."""
        for row, configuration in zip(rows, configurations, strict=True):
            noise = noise_model(configuration.noise) if configuration.noise else self._noise
            error = noise.draw(configuration.generator("estimate"), len(configuration.objects))
            error[:, :3] = _along_approach(error[:, :3], configuration)
            self._errors[row] = error
        self._unseen[np.asarray(rows, int)] = True
        self._builder.reset(rows, configurations)

    def observe(self, state: WorldState, rows: np.ndarray | None = None) -> Observation:
        """The observations ``(k, ...)`` of states ``(k, ...)``.

        Args:
            state: The states; worlds with fewer objects than others have NaN behind theirs.
            rows: Which worlds these are ``(k,)``, each once; by default all.

        Raises:
            MachineError: The physics engine knows no objects.
        """
        if state.objects is None:
            raise MachineError("no estimate from the state: this physics engine knows no objects")
        index = np.arange(self.n) if rows is None else rows
        if self._local is None or self._unseen[index].any():
            self._look(state.objects, index)
        assert self._local is not None
        most = state.objects.shape[1]  # more than anybody has looked at, where a world did not begin
        local = widened(self._local if rows is None else Index(rows).along(self._local, 0), most)
        estimate = poses.multiply(state.objects, local[:, :most, :])
        return self._builder.build(state, estimate, rows)

    def _look(self, objects: Array, rows: np.ndarray) -> None:
        """Worlds are seen for the first time: their errors are fixed to their objects as they are now."""
        at = np.flatnonzero(self._unseen[rows])
        new = rows[at]
        most = objects.shape[1]
        drawn = np.full((len(new), most, 7), np.nan)
        for i, row in enumerate(new):
            error = self._errors[row]
            drawn[i, : len(error)] = error
        local = _error_in_object(Index(at).along(objects, 0), constant(drawn, objects))
        if self._local is None:
            self._local = constant(np.full((self.n, most, 7), np.nan), objects)
        self._local = widened(self._local, most)
        self._local = spliced([self._local], new, [widened(local, self._local.shape[1])])[0]
        self._unseen[new] = False


def _along_approach(errors: Array, configuration: ActorConfiguration) -> Array:
    """Displacements ``(n, 3)`` given across and along the approach, in the robot base frame.

    The approach is that of the place on which each object starts; straight down leaves them as they are, and
    another one turns them by the shortest turn from straight down.
    """
    access = {place.name: place.access for place in configuration.places}
    out = errors.copy()
    for i, actor in enumerate(configuration.objects):
        towards = access.get(actor.on)
        if towards is not None:
            turn = poses.shortest_turn(_DOWN, np.asarray(towards))
            out[i] = poses.rotate(poses.from_rotation_vector(turn), errors[i])
    return out


_DOWN = np.array([0.0, 0.0, -1.0])


def _error_in_object(objects: Array, error: Array) -> Array:
    """Errors given in the base frame ``(..., 7)``, as frames in each object's own."""
    estimate = array_namespace(objects).concat(
        [objects[..., :3] + error[..., :3], poses.quat_multiply(error[..., 3:], objects[..., 3:])], axis=-1
    )
    return poses.multiply(poses.inverse(objects), estimate)
