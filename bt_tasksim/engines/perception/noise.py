"""Stated noise models of the pose estimate, for post-process engines without images."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import part, register


@dataclass(frozen=True)
class NoiseModel:
    """Error of an object's estimated pose: one draw for each object and episode, fixed to the object.

    A subclass may draw otherwise.

    Attributes:
        name: Its name.
        position: Size ``(3,)`` of the position error along the approach's two sides and the approach itself,
            metres (for an approach from above: x, y and z of the robot base frame).
        rotation: Size of each component of the rotation vector, radians.
        uniform: Sizes are half widths of uniform ranges; else standard deviations of normal ones.
    """

    name: str
    position: tuple[float, float, float]
    rotation: float
    uniform: bool = False

    def draw(self, rng: np.random.Generator, n: int) -> Array:
        """Error poses ``(n, 7)``: displacement and rotation in the robot base frame."""
        if self.uniform:
            t = rng.uniform(-1.0, 1.0, (n, 3))
            r = rng.uniform(-1.0, 1.0, (n, 3))
        else:
            t = rng.standard_normal((n, 3))
            r = rng.standard_normal((n, 3))
        rotation = poses.from_rotation_vector(r * self.rotation)
        return np.concatenate([t * np.array(self.position), rotation], axis=-1)


def register_noise(model: NoiseModel) -> NoiseModel:
    """Announce a noise model under its name.

    Raises:
        InputError: Another module has registered another one under it.
    """
    module = str(sys._getframe(1).f_globals.get("__name__", ""))
    object.__setattr__(model, "__qualname__", model.name)  # by which the registry knows a repeated definition
    return register("noise model", model.name, module)(model)


def noise_model(name: str) -> NoiseModel:
    """A noise model by name.

    Raises:
        InputError: There is no such model.
    """
    found: NoiseModel = part("noise model", name)
    return found


register_noise(NoiseModel("none", (0.0, 0.0, 0.0), 0.0))
register_noise(NoiseModel("fine", (0.002, 0.002, 0.002), float(np.deg2rad(2.0))))
# Source: the released original's grasp training, task-sequencing-robotics-simulator.
register_noise(NoiseModel("original", (0.005, 0.005, 0.02), 0.06, uniform=True))
register_noise(NoiseModel("hard", (0.008, 0.008, 0.015), 0.06))
