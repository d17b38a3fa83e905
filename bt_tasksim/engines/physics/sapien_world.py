"""A drawn world in SAPIEN: its scene, fixtures and objects; the robot joins it in `sapien_robot`."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.sapien_joints import JointedBody, add_part
from bt_tasksim.engines.physx import start_physx
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor
from bt_tasksim.scene.shapes import BallPiece, BoxPiece

if TYPE_CHECKING:
    import sapien
    from sapien import physx

CONTACT_OFFSET = {"robot": 0.001, "object": 0.003, "fixture": 0.027}
"""Metres by body; PhysX looks for contacts of two bodies within the sum of theirs. It must exceed what a
falling object covers in one step (2.2 m/s after 25 cm: 22 mm), or the object is stopped only inside. With 4
or 10 mm for fixtures 2 of 40 runs of `pick_and_place_recovering` strain the wrist as they pick the cube once
more, with 27 none; but the farther PhysX looks, the more contacts of convex meshes it makes up, see
`bt_tasksim.engines.physics.sapien_phantoms`."""
LIGHT, MOST = 1.6, 60
"""Kilograms times the solver's position iterations that a body needs between fingers that press with tens of
newtons, and the most iterations. Boxes, cylinders and ovals of 60 g between the Panda's fingers sink in by
0.7 mm with 10 of them, 0.4 with 13, 0.14 with 16 and 0.01 with 20; those of 100 g by 0.4, 0.1, 0 and 0; in
the Ability hand those of 60 g by 0.35 mm with 13, 0.06 with 20 and 0.01 with 30. Each costs 2 % of the time
of a step in which something is held."""
PARTING = 1.0
"""Metres a second at most at which PhysX parts bodies that overlap."""
DAMPING = 0.05
"""Share a second of its spin that air takes from an object."""
_PARTS_BIT = 1 << 10  # of group 2; from here on one bit a fixture that has parts


@dataclass(eq=False)
class World:
    """One episode's scene and what is in it.

    Attributes:
        scene: SAPIEN's scene.
        system: Its physics.
        bodies: What each body is (``fixture``, ``object``, ``base``, ``arm`` or ``hand``) and its index: that
            of `bt_tasksim.core.world.Hidden`, of its fingertip, or -1.
        objects: The objects' bodies; a `JointedBody` for a part of a fixture.
        jointed: The parts among them.
        inertia: Frame of the principal axes (a pose, seven numbers) and principal moments (kg m^2) by object.
        radius: Metres from the middle of an object to its farthest point, at most, by object.
    """

    scene: sapien.Scene
    system: physx.PhysxCpuSystem
    bodies: dict[physx.PhysxRigidBaseComponent, tuple[str, int]] = field(default_factory=dict)
    objects: list[physx.PhysxRigidDynamicComponent] = field(default_factory=list)
    jointed: list[JointedBody] = field(default_factory=list)
    inertia: list[tuple[list[float], list[float]]] = field(default_factory=list)
    radius: list[float] = field(default_factory=list)
    _materials: dict[float, physx.PhysxMaterial] = field(default_factory=dict)
    _entities: list[sapien.Entity] = field(default_factory=list)  # SAPIEN does not keep them alive

    def material(self, friction: float) -> physx.PhysxMaterial:
        """The material of a coefficient of friction."""
        from sapien import physx

        if friction not in self._materials:
            self._materials[friction] = physx.PhysxMaterial(friction, friction, 0.0)
        return self._materials[friction]

    def add(self, body: physx.PhysxRigidBaseComponent, name: str, pose: Iterable[float]) -> None:
        """Put a body into the scene, at a pose of seven numbers."""
        import sapien

        entity = sapien.Entity()
        entity.name = name
        entity.add_component(body)
        entity.set_pose(sapien_pose(pose))
        self.scene.add_entity(entity)
        self._entities.append(entity)


def build_world(configuration: ActorConfiguration, solver_iterations: int) -> World:
    """A fresh scene with the fixtures and objects of a drawn world.

    Args:
        configuration: The drawn world.
        solver_iterations: Position iterations of PhysX's solver.
    """
    import sapien
    from sapien import physx

    start_physx()
    physx.set_scene_config(enable_enhanced_determinism=False, bounce_threshold=2.0)
    physx.set_body_config(solver_position_iterations=solver_iterations, solver_velocity_iterations=0)
    physx.set_shape_config(contact_offset=CONTACT_OFFSET["object"], rest_offset=0.0)
    physx.set_default_material(0.5, 0.5, 0.0)
    system = physx.PhysxCpuSystem()
    scene = sapien.Scene([system])
    scene.set_timestep(1.0 / configuration.physics_frequency)
    world = World(scene, system)
    _add_fixtures(world, configuration)
    _add_objects(world, configuration, solver_iterations)
    return world


def _add_fixtures(world: World, configuration: ActorConfiguration) -> None:
    from sapien import physx

    n = len(configuration.objects)
    for k, fixture in enumerate(configuration.fixtures):
        body = physx.PhysxRigidStaticComponent()
        for box in fixture.boxes:
            shape = physx.PhysxCollisionShapeBox([s / 2 for s in box.size], world.material(box.friction))
            shape.set_local_pose(sapien_pose(box.pose))
            shape.set_contact_offset(CONTACT_OFFSET["fixture"])
            body.attach(shape)
        world.add(body, fixture.name, fixture.pose)
        world.bodies[body] = ("fixture", n + k)


def _add_objects(world: World, configuration: ActorConfiguration, iterations: int) -> None:
    for k, actor in enumerate(configuration.objects):
        body: Any = _free_body(world, actor, iterations) if actor.joint is None else _part(world, actor)
        world.bodies[body.link if isinstance(body, JointedBody) else body] = ("object", k)
        world.objects.append(body)
        geometry = actor.shape()
        axes = [0.0, 0.0, 0.0, *np.asarray(geometry.mass.pose, float)[3:].tolist()]
        world.inertia.append((axes, [float(v) * actor.mass for v in geometry.mass.inertia]))
        world.radius.append(math.hypot(*geometry.extent) / 2.0)
    _let_parts_pass(world, configuration)


def _free_body(world: World, actor: ObjectActor, iterations: int) -> physx.PhysxRigidDynamicComponent:
    from sapien import physx

    geometry = actor.shape()
    body = physx.PhysxRigidDynamicComponent()
    for shape in _shapes(world, actor):
        body.attach(shape)
    body.set_mass(actor.mass)
    body.set_solver_position_iterations(max(iterations, min(math.ceil(LIGHT / actor.mass), MOST)))
    body.set_cmass_local_pose(sapien_pose(geometry.mass.pose))
    body.set_inertia([float(v) * actor.mass for v in geometry.mass.inertia])
    body.set_angular_damping(DAMPING)
    body.set_max_depenetration_velocity(PARTING)
    world.add(body, actor.name, actor.pose)
    return body


def _part(world: World, actor: ObjectActor) -> JointedBody:
    assert actor.joint is not None
    body = add_part(world.scene, actor, actor.joint, _shapes(world, actor), MOST)
    world.jointed.append(body)
    return body


def _shapes(world: World, actor: ObjectActor) -> list[physx.PhysxCollisionShape]:
    from sapien import physx

    shapes: list[physx.PhysxCollisionShape] = []
    material = world.material(actor.friction)
    for piece in actor.shape().collision:
        if isinstance(piece, BoxPiece):
            shape: Any = physx.PhysxCollisionShapeBox(list(piece.half_size), material)
            shape.set_local_pose(sapien_pose(piece.pose))
        elif isinstance(piece, BallPiece):
            shape = physx.PhysxCollisionShapeSphere(piece.radius, material)
            shape.set_local_pose(sapien_pose([*piece.middle, 1.0, 0.0, 0.0, 0.0]))
        else:
            vertices = np.asarray(piece.vertices, np.float32)
            shape = physx.PhysxCollisionShapeConvexMesh(vertices, [1.0, 1.0, 1.0], material)
        shapes.append(shape)
    return shapes


def _let_parts_pass(world: World, configuration: ActorConfiguration) -> None:
    """A fixture and its parts do not touch each other: their joints alone bear and stop them."""
    moving = dict.fromkeys(body.joint.fixture for body in world.jointed)
    for bit, name in enumerate(moving):
        own = [body.link for body in world.jointed if body.joint.fixture == name]
        names = [fixture.name for fixture in configuration.fixtures]
        still = len(configuration.objects) + names.index(name) if name in names else -1
        own += [body for body, (kind, k) in world.bodies.items() if kind == "fixture" and k == still]
        for body in own:
            for shape in body.get_collision_shapes():
                shape.set_collision_groups([1, 1, _PARTS_BIT << bit, 0])


def sapien_pose(pose: Iterable[float]) -> sapien.Pose:
    """SAPIEN's form of a pose of seven numbers."""
    import sapien

    p = [float(v) for v in pose]
    return sapien.Pose(p[:3], p[3:])


def floats(pose: sapien.Pose) -> tuple[float, ...]:
    """The seven numbers of one of SAPIEN's poses, as it pickles them: much quicker than its two arrays."""
    return pose.__getstate__()  # type: ignore[no-any-return]


def array(pose: sapien.Pose) -> Array:
    """One of SAPIEN's poses as ``(7,)``."""
    return np.array(floats(pose))
