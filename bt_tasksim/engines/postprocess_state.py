"""Post-process without images: the estimate is the true pose with a stated error."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bt_tasksim import poses
from bt_tasksim.engines.features import ObservationBuilder
from bt_tasksim.engines.noise import NoiseModel, noise_model
from bt_tasksim.engines.pipeline import Image
from bt_tasksim.errors import MachineError
from bt_tasksim.poses import Array
from bt_tasksim.robot import RobotDescription
from bt_tasksim.scene import ActorConfiguration
from bt_tasksim.world import Observation, WorldModel, WorldState


class StatePostProcess:
    """A post-process engine for fast training and evaluation in simulation.

    Args:
        robot: The robot.
        noise: Error of the estimate, where the world as drawn does not say otherwise.
    """

    perception = "state"

    def __init__(self, robot: RobotDescription, noise: NoiseModel) -> None:
        self.robot = robot
        self.noise = noise

    def reset(self, configuration: ActorConfiguration, model: WorldModel) -> None:
        """See `PostProcessEngine.reset`."""
        n = len(configuration.objects)
        noise = noise_model(configuration.noise) if configuration.noise else self.noise
        self._error = noise.draw(configuration.generator("estimate"), n)
        self._local: Array | None = None
        self._builder = ObservationBuilder(self.robot, configuration)

    def cameras(self, needed: bool) -> tuple[str, ...]:
        """None."""
        return ()

    def observe(self, state: WorldState, images: Mapping[str, Image]) -> Observation:
        """See `PostProcessEngine.observe`."""
        if state.objects is None:
            raise MachineError("no estimate from the state: this physics engine knows no objects")
        if self._local is None:  # the error is fixed to each object as it first was seen
            self._local = _error_in_object(state.objects, self._error)
        estimate = np.empty_like(state.objects)
        for i in range(estimate.shape[0]):
            estimate[i] = poses.multiply(state.objects[i], self._local[i])
        return self._builder.build(state, estimate)


def _error_in_object(objects: Array, error: Array) -> Array:
    """Errors given in the base frame ``(n, 7)``, as frames in each object's own."""
    estimate = np.concatenate(
        [objects[:, :3] + error[:, :3], poses.quat_multiply(error[:, 3:], objects[:, 3:])], axis=-1
    )
    return poses.multiply(poses.inverse(objects), estimate)
