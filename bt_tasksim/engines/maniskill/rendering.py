"""Pictures of an environment, as ManiSkill draws its own scene."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import WorldState
from bt_tasksim.engines.base import RenderingEngine
from bt_tasksim.engines.cameras import CAMERAS, CameraSpec
from bt_tasksim.engines.images import CameraModel, Image
from bt_tasksim.engines.maniskill.environment import Environment
from bt_tasksim.engines.rendering.sapien import ALIASES
from bt_tasksim.engines.rendering.sapien_camera import SceneCamera
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

Size = tuple[int, int] | None


class ManiSkillRendering(RenderingEngine):
    """Draws the scene of a running environment: its present state, whatever state is named.

    Cameras are those of every scene, those of the robot's file, and ManiSkill's own ``render_camera``.

    Args:
        robot: The robot.
        environment: Gives the environment.
        from_base: Gives the robot base frame in ManiSkill's world ``(7,)``.
    """

    def __init__(
        self,
        robot: RobotDescription,
        environment: Callable[[], Environment],
        from_base: Callable[[], Array],
    ) -> None:
        self._environment, self._from_base = environment, from_base
        self._specs = dict(CAMERAS)
        for name, data in robot.cameras.items():
            self._specs[name] = CameraSpec.from_data(data, f"robot file '{robot.source}': camera '{name}'")
        self._scene: Any = None
        self._cameras: dict[tuple[str, Size], SceneCamera] = {}

    def reset(self, configuration: ActorConfiguration) -> None:
        """See `RenderingEngine.reset`: an environment may have built its scene anew."""
        scene = self._environment().base.scene.sub_scenes[0]
        if scene is not self._scene:
            self._scene, self._cameras = scene, {}

    def render(
        self, state: WorldState, camera: str, *, depth: bool = False, size: tuple[int, int] | None = None
    ) -> Image:
        """See `RenderingEngine.render`."""
        camera = ALIASES.get(camera, camera)
        if (camera, size) not in self._cameras:
            model, frame = self._model(camera, size)
            self._cameras[camera, size] = SceneCamera(self._scene, model, frame, "minimal")
        self._scene.update_render()
        return self._cameras[camera, size].take(depth)

    def close(self) -> None:
        """See `Engine.close`."""
        self._scene, self._cameras = None, {}

    def _model(self, camera: str, size: Size) -> tuple[CameraModel, Array]:
        """A camera, and the frame in ManiSkill's world in which it has its pose."""
        base, frame = self._environment().base, self._from_base()
        if camera in self._specs:
            spec = self._specs[camera]
            own = spec if size is None else CameraSpec(spec.position, spec.look_at, size, spec.field_of_view)
            return own.model(camera), frame
        config = base._human_render_camera_configs.get(camera)
        if config is None:
            known = [*self._specs, *base._human_render_camera_configs]
            raise InputError(f"unknown camera '{camera}'{nearest(camera, known)}")
        width, height = size or (config.width, config.height)
        focal = height / 2 / np.tan(config.fov / 2)
        matrix = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]], float)
        pose = np.asarray(config.pose.raw_pose.cpu().numpy(), float).reshape(-1)[:7]
        # SAPIEN's camera looks along x, with y to the left and z up; ours along z.
        optical = poses.multiply(pose, poses.pose(np.zeros(3), np.array([0.5, -0.5, 0.5, -0.5])))
        seen = poses.multiply(poses.inverse(frame), optical)
        return CameraModel(camera, width, height, matrix, seen), frame
