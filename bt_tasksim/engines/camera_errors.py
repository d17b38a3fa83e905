"""Errors of a depth camera, added to rendered depth so that results with images are honest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bt_tasksim.poses import Array


@dataclass(frozen=True)
class DepthNoise:
    """Independent normal errors of each pixel, then rounding, as depth cameras write whole millimetres.

    A real camera's errors are also correlated from pixel to pixel and grow at edges; this model leaves that
    out.

    Attributes:
        constant: Standard deviation at distance 0, metres.
        proportional: Growth of the standard deviation with distance, metres per metre.
        quantum: Step to which depth is rounded, metres; 0 for none.
    """

    constant: float = 0.001
    proportional: float = 0.001
    quantum: float = 0.001

    def sigma(self, depth: Array) -> Array:
        """Standard deviation ``(...)`` at depths ``(...)``, metres."""
        return self.constant + self.proportional * depth

    def apply(self, depth: Array, rng: np.random.Generator) -> Array:
        """A depth image ``(height, width)`` in metres with errors; pixels without depth (0) stay so."""
        noisy = depth + self.sigma(depth) * rng.standard_normal(depth.shape)
        if self.quantum > 0:
            noisy = np.round(noisy / self.quantum) * self.quantum
        return np.where(depth > 0, np.maximum(noisy, 0.0), 0.0)


PERFECT = DepthNoise(0.0, 0.0, 0.0)
"""A camera without errors."""
