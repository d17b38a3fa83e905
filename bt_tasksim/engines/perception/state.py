"""Post-process without images: the estimate is the true pose with a stated error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Observation, WorldModel, WorldState
from bt_tasksim.engines.base import EngineSetup, PostProcessEngine
from bt_tasksim.engines.images import Image
from bt_tasksim.engines.perception.features import ObservationBuilder
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
        n = len(configuration.objects)
        noise = noise_model(configuration.noise) if configuration.noise else self.noise
        self._error = noise.draw(configuration.generator("estimate"), n)
        self._error[:, :3] = _along_approach(self._error[:, :3], configuration)
        self._local: list[list[float]] | None = None
        self._builder = ObservationBuilder(self.robot, configuration)

    def observe(self, state: WorldState, images: Mapping[str, Image]) -> Observation:
        """See `PostProcessEngine.observe`."""
        if state.objects is None:
            raise MachineError("no estimate from the state: this physics engine knows no objects")
        if self._local is None:  # the error is fixed to each object as it first was seen
            self._local = _error_in_object(state.objects, self._error).tolist()
        pairs = zip(state.objects.tolist(), self._local, strict=True)
        estimate = np.array([poses.composed(truth, error) for truth, error in pairs]).reshape(-1, 7)
        return self._builder.build(state, estimate)


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
            out[i] = poses.rotate(_shortest_turn(_DOWN, towards), errors[i])
    return out


def _shortest_turn(a: Array, b: Array) -> Array:
    """Unit quaternion ``(4,)`` of the shortest turn from one unit vector ``(3,)`` to another."""
    q = np.array([1.0 + float(a @ b), *poses.cross(a, b)])
    length = float(np.linalg.norm(q))
    return q / length if length > 1e-9 else np.array([0.0, 1.0, 0.0, 0.0])


_DOWN = np.array([0.0, 0.0, -1.0])


def _error_in_object(objects: Array, error: Array) -> Array:
    """Errors given in the base frame ``(n, 7)``, as frames in each object's own."""
    estimate = np.concatenate(
        [objects[:, :3] + error[:, :3], poses.quat_multiply(error[:, 3:], objects[:, 3:])], axis=-1
    )
    return poses.multiply(poses.inverse(objects), estimate)
