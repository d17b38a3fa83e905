"""A drawn world as a MuJoCo model: robot, objects, fixtures, and which number is whose."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.mujoco_contacts import (
    IMPRATIO,
    Body,
    ContactSurface,
    Solid,
    add_pair,
    touching_pairs,
)
from bt_tasksim.engines.physics.mujoco_joints import add_part_joint
from bt_tasksim.engines.physics.mujoco_robot import add_hull, add_robot, set_inertia
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor
from bt_tasksim.scene.joint_inertia import value_of
from bt_tasksim.scene.joints import Joint
from bt_tasksim.scene.shapes import BallPiece, BoxPiece

if TYPE_CHECKING:
    import mujoco as mj

GRAVITY = 9.81
"""m/s^2."""


@dataclass(frozen=True)
class World:
    """A compiled model, and where things are in its arrays.

    Attributes:
        model: The ``mujoco.MjModel``.
        bodies: What each geom belongs to, in the model's order.
        joint_qpos: Position addresses ``(n_joints,)``, in the robot's joint order.
        joint_dof: Velocity addresses ``(n_joints,)``.
        object_body: Body numbers ``(n_objects,)``.
        object_qpos: Position addresses ``(n_objects, 7)``; of a part of a fixture that of its joint alone.
        object_dof: Velocity addresses ``(n_objects, 6)``; likewise.
        weight: Weights ``(n_objects,)``, N.
        swept: What a part's joint moves: ``(n_objects, 6)``, the velocity of its frame's origin and its
            angular one, both in its own frame, for each metre or radian a second; NaN for what is free.
        latched: Parts with a latch: number of the object, and its joint.
        opened: Position address of each part's joint, and how far open it was drawn.
    """

    model: mj.MjModel
    bodies: tuple[Body, ...]
    joint_qpos: Array
    joint_dof: Array
    object_body: Array
    object_qpos: Array
    object_dof: Array
    weight: Array
    swept: Array
    latched: tuple[tuple[int, Joint], ...]
    opened: tuple[tuple[int, float], ...]

    def object_motion(self, velocity: Array, rotation: Array) -> Array:
        """Velocities ``(..., n_objects, 6)`` as MuJoCo has them of free bodies.

        That is the origin's velocity in the world's frame, and the angular one in the body's.

        Args:
            velocity: Of all degrees of freedom ``(..., nv)``.
            rotation: Of the objects ``(..., n_objects, 4)``.
        """
        moving: Array = velocity[..., self.object_dof]
        parts = np.isfinite(self.swept[:, 0])
        if not parts.any():
            return moving
        swept = self.swept[parts] * moving[..., parts, :1]
        moving = moving.copy()
        moving[..., parts, :3] = poses.rotate(rotation[..., parts, :], swept[..., :3])
        moving[..., parts, 3:] = swept[..., 3:]
        return moving


@dataclass(frozen=True, eq=False)
class BodyNumbers:
    """Numbers of bodies in a model, and counts.

    Attributes:
        tool: The one that carries the tool.
        wrist: The one behind the wrist's sensor.
        root: The robot's root.
        read: Those whose poses are read: the tool's, the fingertips', the objects'.
        n_tips: Number of fingertips.
        n_objects: Number of objects.
        n_fixtures: Number of fixtures.
    """

    tool: int
    wrist: int
    root: int
    read: Array
    n_tips: int
    n_objects: int
    n_fixtures: int

    @classmethod
    def of(cls, robot: RobotDescription, world: World, n_fixtures: int) -> BodyNumbers:
        """The numbers of a world."""
        model = world.model

        def body(link: str) -> int:
            return int(model.body(f"robot/{link}").id)

        wrist = body(robot.wrist_link)
        frames = [body(robot.tool_link), *(body(tip.links[0]) for tip in robot.tips)]
        return cls(
            tool=frames[0],
            wrist=wrist,
            root=int(model.body_rootid[wrist]),
            read=np.array([*frames, *world.object_body.tolist()], np.int32),
            n_tips=len(robot.tips),
            n_objects=len(world.object_body),
            n_fixtures=n_fixtures,
        )


def build_world(mujoco: ModuleType, robot: RobotDescription, configuration: ActorConfiguration) -> World:
    """The model of a drawn world. Gravity is that on objects alone, which the engine applies.

    Raises:
        InputError: The robot or an object cannot be built.
    """
    spec = mujoco.MjSpec()
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    spec.compiler.balanceinertia = True
    spec.compiler.degree = False
    option = spec.option
    option.gravity = [0.0, 0.0, 0.0]
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.impratio = IMPRATIO
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a world that blew up must not start anew
    solids = add_robot(mujoco, spec, robot)
    family: dict[str, list[str]] = {}
    for actor in configuration.objects:
        if actor.joint is not None:
            family.setdefault(actor.joint.fixture, [actor.joint.fixture]).append(actor.name)
    for k, actor in enumerate(configuration.objects):
        beside = () if actor.joint is None else family[actor.joint.fixture]
        solids += _add_object(mujoco, spec, k, actor, beside)
    for k, fixture in enumerate(configuration.fixtures):
        body = Body("fixture", len(configuration.objects) + k, fixture.name)
        carrier = spec.worldbody.add_body(name=f"fixture/{k}", pos=fixture.pose[:3], quat=fixture.pose[3:])
        for j, box in enumerate(fixture.boxes):
            geom = carrier.add_geom(name=f"fixture/{k}/{j}", type=mujoco.mjtGeom.mjGEOM_BOX)
            _place(geom, box.pose, [s / 2 for s in box.size])
            solids.append(Solid(geom.name, body, ContactSurface(box.friction)))
    for a, b in touching_pairs(solids):
        add_pair(spec, a, b)
    try:
        model = spec.compile()
    except ValueError as error:
        raise InputError(
            f"MuJoCo cannot build the robot '{robot.name}' and its scene: {' '.join(str(error).split())}"
        ) from error
    of_name = {solid.name: solid.body for solid in solids}
    objects = range(len(configuration.objects))
    free = np.array([actor.joint is None for actor in configuration.objects], bool)[:, None]
    qpos = np.array([model.joint(f"object/{k}").qposadr[0] for k in objects], int)
    moving = np.array([model.joint(f"object/{k}").dofadr[0] for k in objects], int)
    return World(
        model=model,
        bodies=tuple(of_name[model.geom(i).name] for i in range(model.ngeom)),
        joint_qpos=np.array([model.joint(name).qposadr[0] for name in robot.joints]),
        joint_dof=np.array([model.joint(name).dofadr[0] for name in robot.joints]),
        object_body=np.array([model.body(f"object/{k}").id for k in objects], int),
        object_qpos=qpos[:, None] + free * np.arange(7),
        object_dof=moving[:, None] + free * np.arange(6),
        weight=GRAVITY * np.array([actor.mass for actor in configuration.objects]),
        swept=np.array([_swept(actor.joint) for actor in configuration.objects]).reshape(-1, 6),
        latched=tuple(
            (k, actor.joint)
            for k, actor in enumerate(configuration.objects)
            if actor.joint is not None and actor.joint.latch > 0.0
        ),
        opened=tuple(
            (int(qpos[k]), value_of(actor, actor.joint))
            for k, actor in enumerate(configuration.objects)
            if actor.joint is not None
        ),
    )


def _swept(joint: Joint | None) -> Array:
    if joint is None:
        return np.full(6, np.nan)
    axis, origin = np.array(joint.axis), np.array(joint.origin)
    linear, angular = (np.cross(axis, -origin), axis) if joint.turns else (axis, np.zeros(3))
    return np.concatenate([linear, angular])


def _add_object(
    mujoco: ModuleType, spec: mj.MjSpec, k: int, actor: ObjectActor, beside: Collection[str]
) -> list[Solid]:
    """Add an object; a part of a fixture does not touch what is ``beside`` it."""
    geometry = actor.shape()
    pose = actor.pose if actor.joint is None else actor.joint.zero
    carrier = spec.worldbody.add_body(name=f"object/{k}", pos=pose[:3], quat=pose[3:])
    body = Body("object", k, actor.name)
    if actor.joint is None:
        carrier.add_joint(name=f"object/{k}", type=mujoco.mjtJoint.mjJNT_FREE)
    else:
        add_part_joint(mujoco, carrier, f"object/{k}", actor.joint)
        body = Body("object", k, actor.name, neighbours=frozenset(beside))
    set_inertia(carrier, actor.mass, geometry.mass.pose, actor.mass * geometry.mass.inertia)
    solids = []
    for j, piece in enumerate(geometry.collision):
        geom = carrier.add_geom(name=f"object/{k}/{j}")
        if isinstance(piece, BoxPiece):
            geom.type = mujoco.mjtGeom.mjGEOM_BOX
            _place(geom, piece.pose, piece.half_size)
        elif isinstance(piece, BallPiece):
            geom.type, radius = mujoco.mjtGeom.mjGEOM_SPHERE, piece.radius
            _place(geom, [*piece.middle, 1.0, 0.0, 0.0, 0.0], [radius, radius, radius])
        else:
            geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, geom.name
            geom.contype = geom.conaffinity = 0
            add_hull(spec, geom.name, piece.vertices)
        solids.append(Solid(geom.name, body, ContactSurface(actor.friction)))
    return solids


def _place(geom: mj.MjsGeom, pose: Any, half_size: Any) -> None:
    geom.pos, geom.quat, geom.size = pose[:3], pose[3:], half_size
    geom.contype = geom.conaffinity = 0
