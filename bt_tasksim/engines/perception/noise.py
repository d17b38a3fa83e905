"""Stated noise models of the pose estimate, for post-process engines without images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.poses import Array


@dataclass(frozen=True)
class NoiseModel:
    """Error of an object's estimated pose: one draw for each object and episode, fixed to the object.

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


NOISE = {
    model.name: model
    for model in (
        NoiseModel("none", (0.0, 0.0, 0.0), 0.0),
        NoiseModel("fine", (0.002, 0.002, 0.002), float(np.deg2rad(2.0))),
        # Source: the released original's grasp training, task-sequencing-robotics-simulator.
        NoiseModel("original", (0.005, 0.005, 0.02), 0.06, uniform=True),
        NoiseModel("hard", (0.008, 0.008, 0.015), 0.06),
    )
}


def noise_model(name: str) -> NoiseModel:
    """A noise model by name.

    Raises:
        InputError: There is no such model.
    """
    try:
        return NOISE[name]
    except KeyError:
        raise InputError(f"unknown noise model '{name}'{nearest(name, NOISE)}") from None
