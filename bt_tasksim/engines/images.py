"""What cameras are and what they see."""

from __future__ import annotations

from dataclasses import dataclass

from bt_tasksim.core.poses import Array


@dataclass(frozen=True)
class CameraModel:
    """A calibrated camera.

    Attributes:
        name: Its name.
        width: Pixels.
        height: Pixels.
        matrix: Intrinsic matrix ``(3, 3)``, pixels (OpenCV convention: x right, y down, z forward).
        pose: Pose ``(7,)`` of the camera's optical frame (OpenCV convention) in the robot base frame.
    """

    name: str
    width: int
    height: int
    matrix: Array
    pose: Array


@dataclass(frozen=True)
class Image:
    """What one camera saw.

    Attributes:
        camera: The camera.
        colour: ``(height, width, 3)`` uint8, RGB.
        depth: ``(height, width)`` float32 metres along the optical axis; 0 where nothing was seen.
        taken: When, in seconds of `WorldState.time`; None where it shows the state it came with.
    """

    camera: CameraModel
    colour: Array
    depth: Array | None
    taken: float | None = None
