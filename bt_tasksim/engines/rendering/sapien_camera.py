"""One camera in a scene of SAPIEN, and the pictures that it takes."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.images import CameraModel, Image

NEAR, FAR = 0.02, 20.0
"""Metres between which a camera sees."""
TO_OPTICAL = np.array([0.5, 0.5, -0.5, 0.5])
"""SAPIEN's camera looks along x, with y to the left and z up."""
FORMATS = {
    "default": dict.fromkeys(("Color", "ColorRaw", "PositionSegmentation"), "r32g32b32a32sfloat"),
    "minimal": {
        "Color": "r8g8b8a8unorm",
        "ColorRaw": "r8g8b8a8unorm",
        "PositionSegmentation": "r16g16b16a16sint",
    },
}
"""How pictures are stored, by shaders; SAPIEN keeps it for the whole process, and ManiSkill changes it."""


class SceneCamera:
    """A calibrated camera that stands in a scene.

    Args:
        scene: SAPIEN's scene.
        model: The camera.
        frame: Pose ``(7,)`` in the scene of the frame in which the camera has its own.
        shader: Name of SAPIEN's shaders, ``default`` or ``minimal``; ManiSkill's scenes are lit for these.

    Attributes:
        model: The camera.
        component: SAPIEN's camera.
        entity: What carries it in the scene.
    """

    def __init__(
        self, scene: Any, model: CameraModel, frame: Array | None = None, shader: str = "default"
    ) -> None:
        import sapien

        self.model, self._scene, self._minimal = model, scene, shader == "minimal"
        sapien.render.set_camera_shader_dir(shader)  # for all cameras that are made from now on
        for texture, form in FORMATS[shader].items():
            sapien.render.set_picture_format(texture, form)
        self.component = sapien.render.RenderCameraComponent(model.width, model.height)
        self.component.set_perspective_parameters(
            NEAR, FAR,
            float(model.matrix[0, 0]), float(model.matrix[1, 1]),
            float(model.matrix[0, 2]), float(model.matrix[1, 2]), 0.0,
        )  # fmt: skip
        self.entity = sapien.Entity()
        self.entity.add_component(self.component)
        at = model.pose if frame is None else poses.multiply(frame, model.pose)
        self.entity.set_pose(sapien.Pose(at[:3], at[3:]) * sapien.Pose(np.zeros(3), TO_OPTICAL))
        scene.add_entity(self.entity)

    def take(self, depth: bool) -> Image:
        """What it sees; the scene must be up to date.

        Args:
            depth: Fetch the depth image, too.
        """
        component = self.component
        try:
            component.take_picture()
            colour = component.get_picture("Color")
        except (
            BaseException
        ):  # an interrupt: a scene that is let go of while it is drawn takes the process down
            with contextlib.suppress(RuntimeError):
                component.get_picture("Color")  # waits until it is drawn
            raise
        if self._minimal:
            pixels = np.ascontiguousarray(colour[..., :3])
        else:
            pixels = np.round(255 * np.clip(colour[..., :3], 0, 1)).astype(np.uint8)
        if not depth:
            return Image(self.model, pixels, None)
        if self._minimal:  # millimetres; 0 where nothing is
            millimetres = component.get_picture("PositionSegmentation")[..., 2]
            return Image(self.model, pixels, (-0.001 * millimetres).astype(np.float32))
        position = component.get_picture("Position")
        metres = np.where(position[..., 3] < 1, -position[..., 2], 0).astype(np.float32)
        return Image(self.model, pixels, metres)

    def remove(self) -> None:
        """Take it out of the scene."""
        self._scene.remove_entity(self.entity)
