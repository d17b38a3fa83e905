"""Draws in which nothing starts inside the robot: physics would throw both apart."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import BtTasksimWarning, InputError, NoDrawError, NoVolumeError
from bt_tasksim.core.poses import Array
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.link_parts import DEEP, LinkPart, link_parts
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.fixtures import Fixture
from bt_tasksim.scene.scene import Scene, WorldSource
from bt_tasksim.scene.shapes import BoxPiece, Piece

TOUCHING = 0.001
"""Metres that an object may be in a link."""


REMEMBERED = 64
"""Fixtures of which it is remembered how deep they are in a robot."""


class LinksThere(NamedTuple):
    """Parts of a robot's links where they are.

    Attributes:
        parts: Each part, and where it is as coal has it.
        low: Lowest corners ``(n, 3)`` of boxes around them, along the axes of the robot's base.
        high: Highest corners.
    """

    parts: list[tuple[LinkPart, Any]]
    low: Array
    high: Array

    def near(self, form: Any, at: Any) -> list[tuple[LinkPart, Any]]:
        """The parts that something, as coal has it, may overlap: the box around it meets theirs."""
        low, high = _around(form, at)
        return [self.parts[k] for k in np.flatnonzero(((self.low <= high) & (low <= self.high)).all(axis=1))]


class Inside(NamedTuple):
    """Something that starts in the robot.

    Attributes:
        link: The link that it is in most.
        depth: By how many metres; 0 where it is in none.
    """

    link: str
    depth: float


def clear_draw(
    scene: WorldSource,
    seed: int,
    stream: str,
    robot: RobotDescription,
    stage: int | None = None,
    real: bool = False,
) -> ActorConfiguration:
    """A world of a scene, as whatever runs, judges or trains in it draws it.

    Worlds of a real robot, those that are not drawn from a `Scene`, and those that begin with the hand
    elsewhere than at rest, are not looked at.

    Args:
        scene: Where it is drawn from.
        seed: See `Scene.sample`.
        stream: See `Scene.sample`.
        robot: The robot.
        stage: See `Scene.sample`.
        real: The robot is a real one: what is drawn only says what there is.

    Raises:
        NoDrawError: No world can be drawn with this seed, or something starts inside the robot.
        InputError: See `Scene.sample`.

    Warns:
        BtTasksimWarning: A shape of the robot or of an object is missing, or no body, and is not looked at.
    """
    world = scene.sample(seed, stream, stage)
    if real or not isinstance(scene, Scene) or world.joint_position or world.hand_start:
        return world
    links: LinksThere = robot.derived("links that may be started in", _links_there)
    for fixture in world.fixtures:
        found = _of_fixture(robot, links, fixture)
        if found.depth > DEEP:
            raise NoDrawError(
                _sentence(seed, f"the fixture '{fixture.name}'", found, robot, "put it elsewhere")
            )
    for actor in world.objects:
        found = object_in_robot(links, world, actor.name)
        if found.depth > TOUCHING:
            remedy = "draw it from an area beside the robot"
            if actor.joint is not None:
                remedy = f"put '{actor.joint.fixture}' elsewhere, or draw it less open"
            raise NoDrawError(_sentence(seed, f"'{actor.name}'", found, robot, remedy))
    return world


def _of_fixture(robot: RobotDescription, links: LinksThere, fixture: Fixture) -> Inside:
    """How deep a fixture is in the robot, which is remembered: most are in every draw."""
    known: dict[Fixture, Inside] = robot.derived("fixtures that were looked at", lambda robot: {})
    found = known.get(fixture)
    if found is None:
        if len(known) >= REMEMBERED:
            known.clear()
        found = known[fixture] = fixture_in_robot(links, fixture)
    return found


def _sentence(seed: int, what: str, found: Inside, robot: RobotDescription, remedy: str) -> str:
    return (
        f"with seed {seed} {what} starts {1000 * found.depth:.0f} mm inside '{found.link}' of {robot.name}: "
        f"{remedy}, see 'bt-tasksim check'"
    )


def _links_there(robot: RobotDescription) -> LinksThere:
    """Links at rest that can be looked at, with a warning about others."""
    try:
        links = links_at_rest(robot)
    except InputError as error:
        said = f"what starts inside {robot.name} is not noticed: {error}"
        warnings.warn(said, BtTasksimWarning, stacklevel=2)
        return LinksThere([], np.zeros((0, 3)), np.zeros((0, 3)))
    for left_out in link_parts(robot).left_out:
        said = f"what starts inside {robot.name} is not noticed everywhere: {left_out}"
        warnings.warn(said, BtTasksimWarning, stacklevel=2)
    return links


def links_at_rest(robot: RobotDescription) -> LinksThere:
    """The parts of a robot's links, and where they are at rest with an open hand.

    Parts that are no bodies are not among them, see `bt_tasksim.robot.link_parts.LinkParts`.

    Raises:
        InputError: The URDF, or a file of its shapes, is missing or cannot be read.
    """
    found: LinksThere = robot.derived("links at rest", _links)
    return found


def fixture_in_robot(links: LinksThere, fixture: Fixture) -> Inside:
    """How deep a fixture is in the robot."""
    boxes = [BoxPiece(np.array(box.pose), np.array(box.size) / 2) for box in fixture.boxes]
    return _deepest(links, _solids(fixture.name, fixture.pose_array(), boxes))


def object_in_robot(links: LinksThere, world: ActorConfiguration, name: str) -> Inside:
    """How deep an object of a draw is in the robot.

    Warns:
        BtTasksimWarning: A piece of it is no body, and is not looked at.
    """
    actor = next(actor for actor in world.objects if actor.name == name)
    return _deepest(links, _solids(name, np.array(actor.pose), actor.shape().collision))


def _solids(name: str, pose: Array, pieces: Sequence[Piece]) -> list[tuple[Any, Any]]:
    """Pieces of something at ``pose (7,)`` as coal has them, and where; a warning names what is no body."""
    from bt_tasksim.scene.hulls import placed

    solids = list[tuple[Any, Any]]()
    for piece in pieces:
        try:
            solids.append(placed(piece, pose))
        except NoVolumeError as error:
            said = f"a piece of '{name}' is not looked for inside the robot: {error}"
            warnings.warn(said, BtTasksimWarning, stacklevel=2)
    return solids


def _links(robot: RobotDescription) -> LinksThere:
    from bt_tasksim.core.narrow_phase import coal
    from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics

    parts = link_parts(robot).parts
    joints = np.concatenate([robot.rest, robot.hand_open])
    at = PinocchioKinematics(robot).link_poses(joints, sorted({part.link for part in parts}))
    frames = [poses.multiply(at[part.link], part.pose) for part in parts]
    where = [coal.Transform3s(poses.to_matrix(f[3:]), f[:3]) for f in frames]
    rooms = [_around(part.form, here) for part, here in zip(parts, where, strict=True)]
    corners = np.array(rooms, float).reshape(-1, 2, 3)
    return LinksThere(list(zip(parts, where, strict=True)), corners[:, 0], corners[:, 1])


def _around(form: Any, at: Any) -> tuple[Array, Array]:
    """The lowest and the highest corner ``(3,)`` of a box around something, as coal has it."""
    from bt_tasksim.core.narrow_phase import coal

    room = coal.CollisionObject(form, at).getAABB()
    return room.min_.copy(), room.max_.copy()


def _deepest(links: LinksThere, solids: Sequence[tuple[Any, Any]]) -> Inside:
    """The link that solids overlap most."""
    from bt_tasksim.core.narrow_phase import coal

    request, found = coal.DistanceRequest(), Inside("", 0.0)
    for form, at in solids:
        for part, here in links.near(form, at):
            depth = -float(coal.distance(part.form, here, form, at, request, coal.DistanceResult()))
            if depth > found.depth:
                found = Inside(part.link, depth)
    return found
