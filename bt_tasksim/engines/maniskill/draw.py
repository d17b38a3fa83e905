"""The world of an environment as a configuration: what is there, how large, and where."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import PlaceModel
from bt_tasksim.engines.maniskill.environment import Environment
from bt_tasksim.engines.maniskill.openings import BoxHole, opening
from bt_tasksim.engines.maniskill.schema import TargetEntry
from bt_tasksim.engines.maniskill.shapes import CollisionSolid, boxes, set_upright, solid
from bt_tasksim.engines.physics.sapien_world import array
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor
from bt_tasksim.scene.fixtures import Fixture
from bt_tasksim.scene.shape_kind import BRIGHT

FURNITURE = (0.80, 0.72, 0.60)
"""Colour of fixtures, where our own renderer draws them."""
NEAR = 0.02
"""Metres above a place up to which an object's foot is on it."""


@dataclass(frozen=True, eq=False)
class DrawnActor:
    """An object in the simulation.

    Attributes:
        body: SAPIEN's body.
        solid: What it is to us.
    """

    body: Any
    solid: CollisionSolid

    def pose(self, to_base: Array) -> Array:
        """Our pose ``(7,)`` of it, for ManiSkill's world seen from the robot base frame ``(7,)``."""
        return poses.multiply(to_base, poses.multiply(array(self.body.entity_pose), self.solid.frame))


def body_of(actor: Any) -> Any:
    """SAPIEN's rigid body of an actor."""
    from sapien import physx

    return next(c for c in actor._objs[0].components if isinstance(c, physx.PhysxRigidBaseComponent))


def things(environment: Environment) -> dict[str, DrawnActor]:
    """The objects by name, in the order of the file.

    Raises:
        InputError: One of them is not there, or is nothing that we know.
    """
    found = {}
    for name, entry in environment.file.object_entries.items():
        called = entry.actor or name
        body = body_of(environment.actor(called))
        made = solid(body.get_collision_shapes(), entry.kind, f"actor '{called}'")
        found[name] = DrawnActor(body, set_upright(made, array(body.entity_pose)))
    return found


def fixtures(environment: Environment, to_base: Array) -> tuple[Fixture, ...]:
    """The fixtures where they are.

    Args:
        environment: The environment.
        to_base: ManiSkill's world as seen from the robot base frame ``(7,)``.

    Raises:
        InputError: One of them is not there.
    """
    found = []
    for name, entry in environment.file.fixture_entries.items():
        body = body_of(environment.actor(entry.actor or name))
        pose = poses.multiply(to_base, array(body.entity_pose))
        found.append(Fixture(name, tuple(pose.tolist()), boxes(body.get_collision_shapes(), FURNITURE), ()))
    return tuple(found)


def places(environment: Environment, to_base: Array) -> tuple[PlaceModel, ...]:
    """The places where they are.

    Args:
        environment: The environment.
        to_base: ManiSkill's world as seen from the robot base frame ``(7,)``.

    Raises:
        InputError: An actor is not there.
    """
    fixed = {e.actor or name: name for name, e in environment.file.fixture_entries.items()}
    found = []
    for name, entry in environment.file.places.items():
        body = body_of(environment.actor(entry.actor))
        pose = poses.multiply(to_base, array(body.entity_pose))
        if entry.through is None:
            found.append(_place(name, entry, pose, fixed))
        else:
            solids = boxes(body.get_collision_shapes(), FURNITURE)
            there = opening(solids, np.array(entry.through), f"actor '{entry.actor}'")
            found.append(_hole(name, entry, pose, there, fixed))
    return tuple(found)


def _place(name: str, entry: TargetEntry, pose: Array, fixed: Mapping[str, str]) -> PlaceModel:
    x = poses.rotate(pose[3:], np.array([1.0, 0.0, 0.0]))
    level = poses.pose(pose[:3], poses.yaw(math.atan2(x[1], x[0])))
    return PlaceModel(
        name=name,
        kind=entry.kind,
        pose=poses.multiply(level, poses.pose(np.array(entry.offset))),
        extent=entry.extent,
        centre=entry.centre,
        height=entry.height,
        access=_unit(entry.access),
        exit=_unit(entry.exit),
        fixture=fixed.get(entry.actor, ""),
        clearance=entry.clearance,
    )


def _hole(name: str, entry: TargetEntry, pose: Array, found: BoxHole, fixed: Mapping[str, str]) -> PlaceModel:
    return PlaceModel(
        name=name,
        kind=entry.kind,
        pose=poses.multiply(pose, found.pose),
        extent=found.extent,
        centre=(0.0, 0.0),
        height=found.depth,
        access=_unit(entry.access),
        exit=_unit(entry.exit),
        fixture=fixed.get(entry.actor, ""),
        clearance=entry.clearance,
    )


def configuration(
    environment: Environment, robot: str, to_base: Array, joints: Array, seed: int, stream: str
) -> ActorConfiguration:
    """The world that the environment has just been reset to.

    Args:
        environment: The environment.
        robot: Our robot.
        to_base: ManiSkill's world as seen from the robot base frame ``(7,)``.
        joints: Joint positions ``(n_joints,)``.
        seed: Seed of the draw.
        stream: Its stream.

    Raises:
        InputError: What the environment's file names is not there.
    """
    physics, control = environment.frequencies
    known = places(environment, to_base)
    objects = []
    for k, (name, thing) in enumerate(things(environment).items()):
        pose = thing.pose(to_base)
        material = thing.body.get_collision_shapes()[0].physical_material
        objects.append(
            ObjectActor(
                name=name,
                kind=thing.solid.kind,
                size=thing.solid.size,
                exponents=(1.0, 1.0),
                mass=float(getattr(thing.body, "mass", 1.0)),
                friction=float(material.static_friction),
                pose=tuple(pose.tolist()),
                colour=BRIGHT[k % len(BRIGHT)],
                on=_under(pose, thing.solid.size[2] / 2, known),
            )
        )
    return ActorConfiguration(
        robot=robot,
        objects=tuple(objects),
        fixtures=fixtures(environment, to_base),
        places=known,
        seed=int(seed),
        stream=stream,
        joint_position=tuple(joints.tolist()),
        physics_frequency=physics,
        control_frequency=control,
    )


def _under(pose: Array, half: float, known: tuple[PlaceModel, ...]) -> str:
    """Name of the nearest place below an object; empty where there is none."""
    best, least = "", NEAR
    for place in known:
        local = poses.transform(poses.inverse(place.pose), pose[:3])
        inside = all(abs(float(local[i]) - place.centre[i]) <= place.extent[i] / 2 for i in range(2))
        gap = abs(float(local[2]) - half)
        if inside and gap < least:
            best, least = place.name, gap
    return best


def _unit(direction: tuple[float, float, float]) -> Array:
    vector = np.array(direction)
    return vector / np.linalg.norm(vector)
