"""A noise model from outside: a camera that hangs askew, so that all objects seem to be off to one side."""

from dataclasses import dataclass

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.engines.perception.noise import NoiseModel, register_noise


@dataclass(frozen=True)
class Askew(NoiseModel):
    """Normal errors about a mean that is the same for all objects of a world."""

    sideways: float = 0.0
    """Standard deviation of that mean along y, metres."""

    def draw(self, rng: np.random.Generator, n: int) -> Array:
        errors = super().draw(rng, n)
        errors[:, 1] += self.sideways * rng.standard_normal()
        return errors


ASKEW = register_noise(Askew("askew", position=(0.001, 0.001, 0.001), rotation=0.01, sideways=0.01))
