"""Errors of an RGB-D camera, added to rendered images so that results with images are honest."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import cv2
import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.images import CameraModel


@dataclass(frozen=True)
class CameraErrors:
    """Errors of depth and of the camera's calibration; all normal, but for the rounding.

    Depth gets an independent error in each pixel, a smooth one that changes slowly over the image, and is
    rounded. The calibration is wrong by one draw for each episode. Left out: holes and false depths at
    edges, on shiny and on transparent things, and errors of the lens.

    Attributes:
        constant: Standard deviation of the independent error at distance 0, metres.
        proportional: Its growth with distance, metres per metre.
        smooth: Standard deviation of the smooth error, metres.
        smooth_pixels: Distance in the image over which the smooth error changes.
        quantum: Step to which depth is rounded, metres; 0 for none.
        position: Standard deviation of each coordinate of the calibrated camera's position, metres.
        rotation: Standard deviation of each component of its rotation vector, radians.
    """

    constant: float = 0.001
    proportional: float = 0.001
    smooth: float = 0.001
    smooth_pixels: int = 40
    quantum: float = 0.001
    position: float = 0.0005
    rotation: float = float(np.deg2rad(0.05))

    def depth(self, depth: Array, rng: np.random.Generator) -> Array:
        """A depth image ``(height, width)`` in metres with errors; pixels without depth (0) stay so."""
        noisy = np.asarray(depth, float)
        if self.constant > 0 or self.proportional > 0:
            sigma = self.constant + self.proportional * noisy
            noisy = noisy + sigma * rng.standard_normal(depth.shape, dtype=np.float32)
        if self.smooth > 0:
            coarse = tuple(n // self.smooth_pixels + 3 for n in depth.shape)
            field = self.smooth * rng.standard_normal(coarse)
            size = (coarse[1] * self.smooth_pixels, coarse[0] * self.smooth_pixels)
            wide = cv2.resize(field, size, interpolation=cv2.INTER_CUBIC)
            row, column = rng.integers(0, self.smooth_pixels, 2)
            noisy = noisy + wide[row : row + depth.shape[0], column : column + depth.shape[1]]
        if self.quantum > 0:
            noisy = np.round(noisy / self.quantum) * self.quantum
        return np.where(depth > 0, np.maximum(noisy, 0.0), 0.0)

    def calibration(self, rng: np.random.Generator) -> Array:
        """A draw of the calibration's error: the pose ``(7,)`` as believed, given in the true one."""
        t, r = rng.standard_normal((2, 3))
        return np.concatenate([t * self.position, poses.from_rotation_vector(r * self.rotation)])


def as_calibrated(camera: CameraModel, error: Array) -> CameraModel:
    """The camera where a calibration with this error ``(7,)`` believes it to be."""
    return dataclasses.replace(camera, pose=poses.multiply(camera.pose, error))


PERFECT = CameraErrors(0.0, 0.0, 0.0, 40, 0.0, 0.0, 0.0)
"""A camera without errors."""
