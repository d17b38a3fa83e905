"""Cameras as data: where they stand, how large their pictures are, and what a pixel sees."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.images import CameraModel

LARGEST = 8192
"""Most pixels of a picture from side to side, and from top to bottom."""


def check_size(size: tuple[int, int], owner: str) -> None:
    """Width and height of a picture that can be made.

    Args:
        size: In pixels.
        owner: What it belongs to, for the error's sentence.

    Raises:
        InputError: It cannot.
    """
    if not all(1 <= side <= LARGEST for side in size):
        raise InputError(f"{owner}: {size[0]}x{size[1]} pixels; from 1x1 to {LARGEST}x{LARGEST} are possible")


@dataclass(frozen=True)
class CameraSpec:
    """A camera that stands still.

    Attributes:
        position: ``(3,)`` in the robot base frame, metres.
        look_at: Point ``(3,)`` in the middle of the picture, robot base frame, metres.
        size: Width and height in pixels.
        field_of_view: Vertical opening angle, radians.
    """

    position: tuple[float, float, float]
    look_at: tuple[float, float, float]
    size: tuple[int, int] = (640, 480)
    field_of_view: float = math.radians(45.0)

    @classmethod
    def from_data(cls, data: Mapping[str, Any], owner: str) -> CameraSpec:
        """A camera from plain data, as in a robot's file.

        Args:
            data: ``position``, ``look_at`` and, if wanted, ``size`` and ``field_of_view``.
            owner: What it belongs to, for the error's sentence.

        Raises:
            InputError: Something is missing or makes no camera.
        """
        try:
            unknown = set(data) - {"position", "look_at", "size", "field_of_view"}
            if unknown:
                raise ValueError(f"unknown entry '{sorted(unknown)[0]}'")
            px, py, pz = (float(v) for v in data["position"])
            tx, ty, tz = (float(v) for v in data["look_at"])
            width, height = (int(v) for v in data.get("size", (640, 480)))
            angle = float(data.get("field_of_view", math.radians(45.0)))
        except (KeyError, TypeError, ValueError) as error:
            reason = f"{error} is missing" if isinstance(error, KeyError) else str(error)
            raise InputError(f"{owner}: {reason}") from error
        check_size((width, height), owner)
        if not 0 < angle < math.pi:
            raise InputError(f"{owner}: a camera that opens {math.degrees(angle):g} degrees")
        if math.dist((px, py, pz), (tx, ty, tz)) < 1e-6:
            raise InputError(f"{owner}: it looks at the point where it stands")
        return cls((px, py, pz), (tx, ty, tz), (width, height), angle)

    def model(self, name: str) -> CameraModel:
        """The calibrated camera."""
        width, height = self.size
        focal = height / 2 / math.tan(self.field_of_view / 2)
        matrix = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]], float)
        forward = np.array(self.look_at) - np.array(self.position)
        up = np.array([0.0, 0.0, 1.0])
        if np.linalg.norm(np.cross(forward, up)) < 1e-6 * np.linalg.norm(forward):
            up = np.array([1.0, 0.0, 0.0])
        rotation = poses.frame_from_axes(forward, -up)
        return CameraModel(name, width, height, matrix, poses.pose(self.position, rotation))


CAMERAS: dict[str, CameraSpec] = {
    "overview": CameraSpec((-0.66, 1.30, 1.16), (0.38, 0.0, 0.30), field_of_view=math.radians(43.0)),
    # To the left of the workspace, so that the arm in its rest posture hides nothing of table and shelf.
    "scene": CameraSpec((0.05, 0.95, 1.25), (0.53, -0.05, 0.27), field_of_view=math.radians(46.0)),
    # And to its right: a shelf on the left shows the other one its back.
    "scene_right": CameraSpec((0.05, -0.95, 1.25), (0.53, 0.05, 0.27), field_of_view=math.radians(46.0)),
}
"""Cameras of every scene: one for people, two for perception (RGB-D, fixed beside the robot)."""


def project(camera: CameraModel, point: Array) -> tuple[Array, Array]:
    """Where a camera sees points.

    Args:
        camera: The camera.
        point: Points ``(..., 3)``, robot base frame, metres.

    Returns:
        Pixels ``(..., 2)``, x right and y down, the first pixel's centre at (0.5, 0.5); and depths ``(...)``
        along the optical axis in metres, negative behind the camera.
    """
    local = poses.transform(poses.inverse(camera.pose), point)
    depth = local[..., 2]
    pixel = (local @ camera.matrix.T)[..., :2] / depth[..., None]
    return pixel, depth


def unproject(camera: CameraModel, rows: Array, columns: Array, depth: Array) -> Array:
    """Points ``(..., 3)``, base frame, of pixels ``rows``, ``columns (...)`` with ``depth (...)`` metres."""
    x = (columns + 0.5 - camera.matrix[0, 2]) / camera.matrix[0, 0]
    y = (rows + 0.5 - camera.matrix[1, 2]) / camera.matrix[1, 1]
    return poses.transform(camera.pose, np.stack([x * depth, y * depth, depth], axis=-1))
