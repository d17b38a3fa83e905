"""Whether something of a scene stands in its robot before anything has moved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.checking.robot_touching import DEEP, LinkPart, link_part
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.robot.description import RobotDescription, load_robot
from bt_tasksim.robot.urdf_visuals import load_collisions
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.hulls import placed
from bt_tasksim.scene.shapes import BoxPiece, Piece

if TYPE_CHECKING:
    from bt_tasksim.scene.scene import Scene, WorldSource


TOUCHING = 0.001
"""Metres that an object may be in a link: what physics parts without a blow."""


def check_room(scene: Scene, worlds: Sequence[ActorConfiguration], report: Report) -> None:
    """No furniture and no object stands in the robot, which is at rest with an open hand.

    Args:
        scene: The scene.
        worlds: Draws of it.
        report: Where findings go.
    """
    robot = load_robot(scene.robot)
    try:
        links = robot.derived("links at rest", _links)
    except InputError as error:
        what = f"was not compared with what stands there: {error}"
        report.add(WARNING, scene.name, "robot", what, "put the files of its URDF there")
        return
    for fixture in worlds[0].fixtures:
        boxes = [BoxPiece(np.array(box.pose), np.array(box.size) / 2) for box in fixture.boxes]
        link, depth = _deepest(links, fixture.pose_array(), boxes)
        if depth > DEEP:
            what = f"stands {1000 * depth:.0f} mm in '{link}' of {robot.name}"
            report.add(ERROR, scene.name, f"fixture '{fixture.name}'", what, "put it elsewhere, by its 'at'")
    for name in scene.object_names:
        deep = [found for world in worlds if (found := _of_object(links, world, name))[1] > TOUCHING]
        if deep:
            link, depth = max(deep, key=lambda found: found[1])
            often = f"in {len(deep)} of {len(worlds)} draws"
            what = f"is in '{link}' of {robot.name} {often}, by {1000 * depth:.0f} mm"
            level = ERROR if len(deep) == len(worlds) else WARNING
            report.add(level, scene.name, name, what, "draw it from an area beside the robot")


def refuse_in_robot(scene: WorldSource, seed: int) -> None:
    """Refuse a draw in which an object begins in the robot: physics would throw both apart.

    A single run is refused; in an evaluation, which is about all draws, such a one is a failure like others,
    and `check_room` says beforehand how many there are. Worlds that are not drawn from a `Scene`, and robots
    whose shapes are not there, are not looked at.

    Raises:
        InputError: One does; it says which and by how much.
    """
    from bt_tasksim.scene.scene import Scene

    if not isinstance(scene, Scene):
        return
    robot, world = load_robot(scene.robot), scene.sample(seed)
    try:
        links = robot.derived("links at rest", _links)
    except InputError:
        return
    if found := _first_in(links, world, TOUCHING):
        name, link, depth = found
        raise InputError(
            f"with seed {seed} '{name}' starts {1000 * depth:.0f} mm inside '{link}' of {robot.name}: draw "
            f"it from an area beside the robot, see 'bt-tasksim check'"
        )


def in_robot(robot: RobotDescription, world: ActorConfiguration) -> str:
    """The first object of a draw that begins deep in the robot at rest; empty where none does."""
    found = _first_in(robot.derived("links at rest", _links), world, DEEP)
    return found[0] if found else ""


def _first_in(
    links: Sequence[tuple[LinkPart, Any]], world: ActorConfiguration, least: float
) -> tuple[str, str, float] | None:
    """The first object that begins farther than ``least`` metres in the robot, the link, and how far."""
    for actor in world.objects:
        link, depth = _of_object(links, world, actor.name)
        if depth > least:
            return actor.name, link, depth
    return None


def _links(robot: RobotDescription) -> list[tuple[LinkPart, Any]]:
    """The parts of its links, and where they are at rest."""
    from bt_tasksim.core.narrow_phase import coal
    from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics

    parts = [part for shape in load_collisions(robot.urdf) if (part := link_part(shape)) is not None]
    joints = np.concatenate([robot.rest, robot.hand_open])
    at = PinocchioKinematics(robot).link_poses(joints, sorted({part.link for part in parts}))
    frames = [poses.multiply(at[part.link], part.pose) for part in parts]
    where = [coal.Transform3s(poses.to_matrix(f[3:]), f[:3]) for f in frames]
    return list(zip(parts, where, strict=True))


def _of_object(
    links: Sequence[tuple[LinkPart, Any]], world: ActorConfiguration, name: str
) -> tuple[str, float]:
    actor = next(actor for actor in world.objects if actor.name == name)
    return _deepest(links, np.array(actor.pose), actor.shape().collision)


def _deepest(
    links: Sequence[tuple[LinkPart, Any]], pose: Array, pieces: Sequence[Piece]
) -> tuple[str, float]:
    """The link that pieces of a body at ``pose (7,)`` overlap most, and by how many metres."""
    from bt_tasksim.core.narrow_phase import coal

    request, found = coal.DistanceRequest(), ("", 0.0)
    for piece in pieces:
        form, at = placed(piece, pose)
        for part, here in links:
            depth = -float(coal.distance(part.form, here, form, at, request, coal.DistanceResult()))
            if depth > found[1]:
                found = part.link, depth
    return found
