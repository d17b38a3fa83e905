"""Drawn worlds for another process: files by name and content, and limits on what is built from them."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.files import file_version
from bt_tasksim.core.joints import KINDS as JOINTS
from bt_tasksim.core.resources import asset
from bt_tasksim.engines.perception.noise import noise_model
from bt_tasksim.engines.remote.plain import shown
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.configuration import STREAMS, ActorConfiguration, ObjectActor
from bt_tasksim.scene.part_kind import PART
from bt_tasksim.scene.shapes import KINDS

MOST_ACTORS = 128
MOST_BOXES = 2048
MOST_GRASPS = 64
FREQUENCIES = (1, 10_000)
"""Hz, of physics and of control."""
_FAR = 1000.0
_SIZES = (1e-4, 100.0)
_STRONGEST = 1e5


def for_sending(configuration: ActorConfiguration, robot: RobotDescription) -> ActorConfiguration:
    """The configuration with the robot by its name and meshes by name and content, instead of paths.

    Raises:
        InputError: A mesh file is gone.
    """
    objects = tuple(
        dataclasses.replace(actor, mesh=mesh_name(actor.mesh)) if actor.mesh else actor
        for actor in configuration.objects
    )
    return dataclasses.replace(configuration, robot=robot.name, objects=objects)


def as_received(
    configuration: ActorConfiguration, robot: RobotDescription, folder: Path | None = None
) -> ActorConfiguration:
    """A configuration from `for_sending` on the other side, checked, with this side's own files.

    Args:
        configuration: The configuration.
        robot: The robot, whose name it must have.
        folder: Where mesh files are looked for, besides the bundled ones.

    Raises:
        InputError: Something in it cannot be built; says what.
    """
    check(configuration, robot)
    objects = tuple(
        dataclasses.replace(actor, mesh=str(find_mesh(actor.mesh, folder))) if actor.mesh else actor
        for actor in configuration.objects
    )
    return dataclasses.replace(configuration, robot=str(robot.source), objects=objects)


def mesh_name(path: str) -> str:
    """Name and content of a mesh file, ``bottle.obj#<sha256>``."""
    file = Path(path)
    if not file.is_file():
        raise InputError(f"no mesh file '{path}'")
    return f"{file.name}#{_digest(file, file_version(file))}"


def find_mesh(name: str, folder: Path | None) -> Path:
    """The file of a `mesh_name`: a bundled one, or one in a folder; never any other path.

    Raises:
        InputError: There is none of this name and content.
    """
    plain, _, digest = name.rpartition("#")
    if not plain or Path(plain).name != plain or plain.startswith("."):
        raise InputError(f"{shown(name)} is no name of a mesh file")
    places = [asset("objects"), *([folder] if folder is not None else [])]
    found = [place / plain for place in places if (place / plain).is_file()]
    for file in found:
        if _digest(file, file_version(file)) == digest:
            return file
    if found:
        raise InputError(f"mesh file '{plain}' is not the same on the server and the client: copy it over")
    raise InputError(
        f"the server has no mesh file '{plain}': copy it into a folder there, and name that by --objects"
    )


def check(configuration: ActorConfiguration, robot: RobotDescription) -> None:
    """Refuse what no engine should be asked to build, however well formed it is.

    Raises:
        InputError: Says what is wrong.
    """
    c = configuration
    if c.robot != robot.name:
        raise InputError(f"the world is for the robot {shown(c.robot)}, and this engine's is '{robot.name}'")
    if max(len(c.objects), len(c.fixtures), len(c.places)) > MOST_ACTORS:
        raise InputError(f"a world has at most {MOST_ACTORS} objects, fixtures and places")
    if sum(len(f.boxes) for f in c.fixtures) + sum(len(o.boxes) for o in c.objects) > MOST_BOXES:
        raise InputError(f"a world's fixtures and their parts have at most {MOST_BOXES} boxes")
    low, high = FREQUENCIES
    if not (low <= c.control_frequency <= c.physics_frequency <= high):
        raise InputError(
            f"frequencies lie between {low} and {high} Hz, that of physics above that of control"
        )
    if c.seed < 0 or c.stream not in STREAMS:
        raise InputError("a world's seed is not negative, and its stream is one of " + ", ".join(STREAMS))
    for name, values, n in (
        ("joint_position", c.joint_position, len(robot.joints)),
        ("hand_start", c.hand_start, 4),
    ):
        if len(values) not in (0, n):
            raise InputError(f"'{name}' has {n} numbers or none, found {len(values)}")
    if c.noise:
        noise_model(c.noise)
    for actor in c.objects:
        _check_object(actor)
    for fixture in c.fixtures:
        _pose(fixture.pose, f"fixture {shown(fixture.name)}")
        _boxes(fixture.boxes, fixture.name)
    for place in c.places:
        _pose(tuple(place.pose), f"place {shown(place.name)}")
    names = [actor.name for actor in c.objects]
    if len(set(names)) < len(names):
        raise InputError("two objects of a world have the same name")
    if c.disturbance is not None and c.disturbance.object not in names:
        raise InputError(f"what is disturbed is not in the world{nearest(c.disturbance.object, names)}")


def _check_object(actor: Any) -> None:
    where = f"object {shown(actor.name)}"
    if actor.kind == PART:
        _check_part(actor, where)
    elif actor.boxes or actor.joint is not None:
        raise InputError(f"{where}: only parts of fixtures have boxes and a joint")
    elif actor.kind not in KINDS:  # whose own sentence would show what was sent as it is
        raise InputError(f"{where} is of unknown kind {shown(actor.kind)}{nearest(actor.kind, KINDS)}")
    _pose(actor.pose, where)
    _within(actor.size, _SIZES, f"{where}: size")
    _within(actor.known_size or actor.size, _SIZES, f"{where}: known size")
    _within((actor.mass,), (1e-6, 1e4), f"{where}: mass")
    _within((actor.friction,), (0.0, 100.0), f"{where}: friction")
    _within(actor.colour, (0.0, 1.0), f"{where}: colour")
    if len(actor.grasps) > MOST_GRASPS:
        raise InputError(f"{where}: at most {MOST_GRASPS} grasps, found {len(actor.grasps)}")
    if actor.symmetry is not None:
        _within((actor.symmetry,), (0, 360), f"{where}: symmetry")


def _check_part(actor: ObjectActor, where: str) -> None:
    joint = actor.joint
    if joint is None or not actor.boxes:
        raise InputError(f"{where}: a part of a fixture has boxes and a joint")
    _boxes(actor.boxes, actor.name)
    if joint.kind not in JOINTS:
        raise InputError(
            f"{where}: its joint is of unknown kind {shown(joint.kind)}{nearest(joint.kind, JOINTS)}"
        )
    _pose(joint.zero, f"{where}: where its value is 0")
    if len(joint.axis) != 3 or abs(math.hypot(*joint.axis) - 1.0) > 1e-3:
        raise InputError(f"{where}: the axis of its joint is a unit vector")
    _within(joint.origin, (-_FAR, _FAR), f"{where}: origin of its joint")
    if len(joint.origin) != 3 or len(joint.limits) != 2 or not joint.limits[0] < joint.limits[1]:
        raise InputError(f"{where}: a joint has an origin and two limits, the lower one first")
    _within(joint.limits, (-_FAR, _FAR), f"{where}: limits")
    forces = (joint.friction, joint.damping, joint.stiffness, joint.latch)
    _within(forces, (0.0, _STRONGEST), f"{where}: friction, damping, stiffness and latch")
    _within((joint.rest,), (-_FAR, _FAR), f"{where}: rest of its spring")


def _boxes(boxes: Iterable[Box], whose: str) -> None:
    for box in boxes:
        _pose(box.pose, f"a box of {shown(whose)}")
        _within(box.size, _SIZES, f"size of a box of {shown(whose)}")
        _within((box.friction,), (0.0, 100.0), "friction")


def _pose(pose: tuple[float, ...], where: str) -> None:
    if len(pose) != 7 or max(map(abs, pose[:3])) > _FAR or abs(math.hypot(*pose[3:]) - 1.0) > 1e-3:
        raise InputError(f"{where}: a pose is a position within {_FAR:g} m and a unit quaternion")


def _within(values: tuple[float, ...], limits: tuple[float, float], what: str) -> None:
    low, high = limits
    for value in values:
        if not low <= value <= high:
            raise InputError(f"{what} should lie between {low:g} and {high:g}, found {shown(value)}")


@lru_cache(maxsize=256)
def _digest(path: Path, version: tuple[int, ...]) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
