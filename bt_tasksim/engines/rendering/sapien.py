"""Rendering by SAPIEN, in a scene of its own without any physics.

The scene is fed with joint positions and object poses, so any physics engine, or a real robot's sensors, can
stand before it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any, Self

import numpy as np

from bt_tasksim.core.errors import InputError, MachineError, nearest
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import PlaceModel, WorldState
from bt_tasksim.engines.base import EngineSetup, RenderingEngine
from bt_tasksim.engines.cameras import CAMERAS, CameraSpec
from bt_tasksim.engines.images import CameraModel, Image
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.engines.physx import start_physx
from bt_tasksim.engines.rendering import materials
from bt_tasksim.engines.rendering.sapien_camera import SceneCamera
from bt_tasksim.engines.vulkan import render_device, use_software_driver
from bt_tasksim.robot.description import RobotDescription, load_robot
from bt_tasksim.robot.urdf_visuals import LinkVisual, load_visuals
from bt_tasksim.scene import meshes
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor

ALIASES = {"perception": "scene"}
Size = tuple[int, int] | None
"""Width and height in pixels; None for the camera's own."""
_FLOOR = -0.75
_MAT = 0.0005


@register("engine/rendering", "sapien")
class SapienRendering(RenderingEngine):
    """A `RenderingEngine`; one instance serves any number of episodes.

    Args:
        cameras: Further cameras by name, or other ones in place of `bt_tasksim.engines.cameras.CAMERAS`; a
            robot's data file may bring its own, too.
        shadow_size: Width of the shadow map in pixels; 0 for no shadows.

    Raises:
        MachineError: SAPIEN finds no render device on this machine.
    """

    def __init__(self, cameras: Mapping[str, CameraSpec] | None = None, shadow_size: int = 1024) -> None:
        use_software_driver()
        try:
            import sapien
            from sapien import render
        except ImportError:
            raise MachineError(
                "rendering needs the package sapien: install bt-tasksim with its extra 'sim'"
            ) from None
        start_physx()
        render.set_log_level("error")
        try:
            self._system = render.RenderSystem(sapien.Device(render_device()))
            self._scene = sapien.Scene([self._system])
        except RuntimeError as error:
            raise MachineError(
                f"SAPIEN finds no Vulkan device to draw with ({error}): fetch the software driver with "
                f"'make demo', or run without rendering"
            ) from error
        self._sapien, self._render = sapien, render
        self._own = dict(cameras or {})
        self._specs: dict[str, CameraSpec] = {}
        self._cameras: dict[tuple[str, Size], tuple[CameraSpec, SceneCamera]] = {}
        self._robot: RobotDescription | None = None
        self._kinematics: PinocchioKinematics | None = None
        self._links: dict[str, Any] = {}
        self._objects: list[Any] = []
        self._fixtures: list[Any] = []
        self._spots: list[Any] = []
        self._drawn: tuple[Any, ...] = ()
        materials.add_lights(self._scene, shadow_size)
        self._add_room()

    @classmethod
    def create(cls, robot: RobotDescription, setup: EngineSetup) -> Self:
        """See `Engine.create`; the robot is that of each episode."""
        return cls()

    def reset(self, configuration: ActorConfiguration) -> None:
        """Prepare for an episode: its robot, fixtures and objects.

        Raises:
            InputError: The robot's file or one of its meshes is missing or wrong.
        """
        robot = load_robot(configuration.robot)
        if robot is not self._robot:
            self._build_robot(robot)
        if configuration.fixtures != self._drawn:
            self._remove(self._fixtures)
            for fixture in configuration.fixtures:
                planks = self._planks(fixture.boxes)
                self._fixtures.append(self._add(fixture.name, planks, fixture.pose_array()))
            self._drawn = configuration.fixtures
        self._remove(self._objects)
        self._objects = [self._add_object(actor) for actor in configuration.objects]
        self._remove(self._spots)
        self._spots = [self._add_spot(place) for place in configuration.places if place.kind == "spot"]

    def camera(self, name: str) -> CameraModel:
        """The calibrated camera of a name.

        Raises:
            InputError: There is no such camera.
        """
        return self._camera(name, None).model

    def render(
        self, state: WorldState, camera: str, *, depth: bool = False, size: tuple[int, int] | None = None
    ) -> Image:
        """What the named camera sees now.

        Args:
            state: Unbatched; without object poses (a real robot) objects stay where they were drawn.
            camera: Its name.
            depth: Fetch the depth image, too.
            size: Width and height in pixels; None for the camera's own.

        Raises:
            InputError: There is no such camera.
            RuntimeError: The engine was not reset.
        """
        if self._kinematics is None:
            raise RuntimeError("nothing can be drawn: the rendering engine was not reset")
        stands = self._camera(camera, size)
        for name, pose in self._kinematics.link_poses(state.joint_position, list(self._links)).items():
            self._links[name].set_pose(self._pose(pose))
        if state.objects is not None:
            for entity, pose in zip(self._objects, state.objects, strict=True):
                entity.set_pose(self._pose(pose))
        self._scene.update_render()
        return stands.take(depth)

    def close(self) -> None:
        """Let go of the scene."""
        self._remove(self._objects)
        self._remove(self._spots)
        self._remove(self._fixtures)
        self._remove(list(self._links.values()))
        self._links, self._cameras, self._robot, self._kinematics, self._drawn = {}, {}, None, None, ()

    def _camera(self, name: str, size: Size) -> SceneCamera:
        name = ALIASES.get(name, name)
        specs = self._specs or {**CAMERAS, **self._own}
        spec = specs.get(name)
        if spec is None:
            raise InputError(f"unknown camera '{name}'{nearest(name, [*specs, *ALIASES])}")
        spec = spec if size is None else dataclasses.replace(spec, size=size)
        known = self._cameras.get((name, size))
        if known is not None and known[0] == spec:
            return known[1]
        if known is not None:
            known[1].remove()
        stands = SceneCamera(self._scene, spec.model(name))
        self._cameras[name, size] = (spec, stands)
        return stands

    def _build_robot(self, robot: RobotDescription) -> None:
        specs = {
            name: CameraSpec.from_data(data, f"robot file '{robot.source}': camera '{name}'")
            for name, data in robot.cameras.items()
        }
        kinematics, visuals = PinocchioKinematics(robot), load_visuals(robot.urdf)
        self._remove(list(self._links.values()))
        by_link: dict[str, list[LinkVisual]] = {}
        for visual in visuals:
            by_link.setdefault(visual.link, []).append(visual)
        self._links = {
            name: self._add(name, [self._link_shape(v) for v in parts], np.array([0, 0, 0, 1, 0, 0, 0.0]))
            for name, parts in by_link.items()
        }
        self._robot, self._kinematics, self._specs = robot, kinematics, {**CAMERAS, **specs, **self._own}

    def _link_shape(self, visual: LinkVisual) -> Any:
        render = self._render
        coat = materials.material(visual.colour or (0.75, 0.75, 0.76))
        size = np.array(visual.size)
        pose = self._pose(np.array(visual.pose))
        match visual.kind:
            case "mesh":
                own = None if visual.colour is None else coat
                shape = render.RenderShapeTriangleMesh(visual.mesh, size, own)
            case "box":
                shape = render.RenderShapeBox(size / 2, coat)
            case "sphere":
                shape = render.RenderShapeSphere(float(size[0]), coat)
            case _:
                shape = render.RenderShapeCylinder(float(size[0]), float(size[1]) / 2, coat)
                # SAPIEN's cylinder lies along x.
                pose = pose * self._sapien.Pose([0, 0, 0], [0.5**0.5, 0, 0.5**0.5, 0])
        shape.local_pose = pose
        return shape

    def _add_object(self, actor: ObjectActor) -> Any:
        if actor.boxes:
            return self._add(actor.name, self._planks(actor.boxes), np.array(actor.pose))
        shape = materials.mesh_shape(actor.shape().visual, materials.material(actor.colour))
        return self._add(actor.name, [shape], np.array(actor.pose))

    def _planks(self, boxes: Iterable[Box]) -> list[Any]:
        shapes = []
        for box in boxes:
            shape = materials.plank_shape(box.size, materials.material(box.colour, box.material))
            shape.local_pose = self._pose(np.array(box.pose))
            shapes.append(shape)
        return shapes

    def _add_spot(self, place: PlaceModel) -> Any:
        """A thin mat that marks where something is to stand."""
        x, y = place.extent
        outline = meshes.rounded_rectangle(x / 2, y / 2, min(x, y) / 6)
        mat = materials.mesh_shape(meshes.prism(outline, 2 * _MAT), materials.material((0.97, 0.96, 0.90)))
        return self._add(place.name, [mat], np.asarray(place.pose, float))

    def _add_room(self) -> None:
        # They shine evenly: a light background whichever way a camera looks, and beyond the edge of the
        # shadow map, where SAPIEN takes everything to be in the shade.
        floor = self._render.RenderMaterial(base_color=[0, 0, 0, 1], roughness=1, specular=0)
        floor.emission = [*materials.linear((0.83, 0.845, 0.86))[:3], 1.0]
        wall = self._render.RenderMaterial(base_color=[0, 0, 0, 1], roughness=1, specular=0)
        wall.emission = [*materials.linear((0.90, 0.915, 0.93))[:3], 1.0]
        half, height = 6.0, 8.0
        parts = [materials.plank_shape((2 * half, 2 * half, 0.02), floor)]
        for x, y in ((half, 0.0), (-half, 0.0), (0.0, half), (0.0, -half)):
            part = materials.plank_shape((0.02 if x else 2 * half, 0.02 if y else 2 * half, height), wall)
            part.local_pose = self._sapien.Pose([x, y, height / 2])
            parts.append(part)
        self._add("room", parts, np.array([0.0, 0.0, _FLOOR - 0.01, 1, 0, 0, 0]))

    def _add(self, name: str, shapes: list[Any], pose: Array) -> Any:
        body = self._render.RenderBodyComponent()
        for shape in shapes:
            body.attach(shape)
        entity = self._sapien.Entity()
        entity.name = name
        entity.add_component(body)
        entity.set_pose(self._pose(pose))
        self._scene.add_entity(entity)
        return entity

    def _remove(self, entities: list[Any]) -> None:
        for entity in entities:
            self._scene.remove_entity(entity)
        entities.clear()

    def _pose(self, pose: Array) -> Any:
        return self._sapien.Pose(pose[:3], pose[3:])
