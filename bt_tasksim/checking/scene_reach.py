"""Whether a scene's objects can be held by its robot's hand where they stand, and put where they go."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.checking.part_reach import part_tool_poses
from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel, PlaceModel
from bt_tasksim.robot.description import RobotDescription, load_robot
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor
from bt_tasksim.scene.grips import WIDER, Grips, fits_between
from bt_tasksim.scene.relations import relation_named
from bt_tasksim.scene.relations.base import Presence
from bt_tasksim.scene.shapes import ShapeSize, resting_height
from bt_tasksim.scene.specs import STARTS, Goal

if TYPE_CHECKING:
    from bt_tasksim.engines.kinematics.batch import BatchKinematics
    from bt_tasksim.scene.scene import Scene

ACROSS = 0.5
"""Largest cosine between the direction in which a hand comes and that in which its fingers close."""
TURNS = 4
"""Headings of an object at its goal that are tried; as many turns about the axis of a round one."""


def check_objects(scene: Scene, worlds: Sequence[ActorConfiguration], report: Report) -> None:
    """The hand opens wide enough for every object, and the arm reaches it from where hands come there.

    Args:
        scene: The scene.
        worlds: Draws of it.
        report: Where findings go.
    """
    robot = load_robot(scene.robot)
    for name in scene.object_names:
        wide, far, held, none = [], 0, 0, 0
        for world in worlds:
            actor = _actor(world, name)
            grips = grips_of(actor)
            if not len(grips):  # such a part, a button, is not for a hand to take
                none += actor.joint is None
                continue
            if not fits_between(grips.widths, robot.opening).any():
                wide.append(float(grips.widths.min()))
                continue
            held += 1
            far += not is_reached(robot, world, name)
        if none:
            what = f"has nothing that two fingers could close on, in {none} of {len(worlds)} draws"
            level = ERROR if none == len(worlds) else WARNING
            report.add(level, scene.name, name, what, "give it 'grasps', or another shape")
        if wide:
            what = (
                f"is {1000 * min(wide):.0f} mm wide where it is narrowest, in {len(wide)} of {len(worlds)} "
                f"draws, and {_takes(robot)}"
            )
            level = ERROR if len(wide) == len(worlds) else WARNING
            report.add(level, scene.name, name, what, "make it narrower, or take another hand")
        if far:
            where, remedy = _out_of_reach(robot, worlds[0], name, f"{far} of {held} draws")
            report.add(ERROR if far == held else WARNING, scene.name, name, where, remedy)


def _out_of_reach(
    robot: RobotDescription, world: ActorConfiguration, name: str, often: str
) -> tuple[str, str]:
    """What is wrong with an object or a part that is too far away, and what to do."""
    actor, nearer = _actor(world, name), f"nearer to {_ahead(robot)}"
    if actor.joint is not None:
        return f"is out of reach by its own grasps in {often}", f"move its furniture {nearer}"
    access = _said(_place(world, actor.on).access)
    what = f"is out of reach on '{actor.on}' in {often}, from {access}"
    return what, f"move it {nearer}, or give its place another 'access'"


def is_reached(robot: RobotDescription, world: ActorConfiguration, name: str) -> bool:
    """The arm brings the hand to where an object is held, as hands come to its place, or to that part."""
    actor = _actor(world, name)
    grips, pose = grips_of(actor), np.array(actor.pose)
    if actor.joint is not None:
        return _any_reached(robot, part_tool_poses(robot, pose, grips))
    access = _place(world, actor.on).access
    return _any_reached(robot, tool_poses(robot, actor.model(), pose, grips, access))


def check_goals(scene: Scene, worlds: Sequence[ActorConfiguration], report: Report) -> None:
    """The goals' places have room for their objects, and the arm can put them there.

    Args:
        scene: The scene.
        worlds: Draws of it.
        report: Where findings go.
    """
    robot = load_robot(scene.robot)
    for number, goal in enumerate(goals_of(worlds[0])):
        small, far, known = 0, 0, 0
        for world in worlds:
            goal = goals_of(world)[number]
            places = {place.name: place for place in world.places}
            if goal.place not in places or goal.object not in scene.object_names:
                continue
            presence = relation_named(goal.relation).presence
            if presence < Presence.THERE:
                continue
            known += 1
            actor, place = _actor(world, goal.object), places[goal.place]
            small += presence >= Presence.WITHIN and not (_passed(goal, place) or _fits(actor.model(), place))
            far += not _any_reached(robot, _at_goal(robot, actor, place))
        where = f"goal of '{goal.object}'"
        if small:
            word = goal.relation if goal.relation in STARTS else "on"
            what = f"asks for '{goal.object}' {word} '{goal.place}', which is too small for it in {small} of "
            marked = any(place.name == goal.place and place.kind == "spot" for place in worlds[0].places)
            level = ERROR if small == known and not marked else WARNING  # a mark bears nothing
            how = "give the spot a larger extent" if marked else "name a larger place"
            report.add(level, scene.name, where, f"{what}{known} draws", how)
        if far:
            what = f"is out of reach on '{goal.place}' in {far} of {known} draws, from "
            level = ERROR if far == known else WARNING
            access = _said(_place(worlds[0], goal.place).access)
            remedy = f"name a place that the arm reaches, nearer to {_ahead(robot)}"
            report.add(level, scene.name, where, f"{what}{access}", remedy)


def goals_of(world: ActorConfiguration) -> Sequence[Goal]:
    """The goals of a world."""
    return world.goals


def grips_of(actor: ObjectActor) -> Grips:
    """Where two fingers may hold an object, as it is known."""
    solid = actor.model().solid
    assert solid is not None
    found: Grips = solid.grips
    return found


def tool_poses(
    robot: RobotDescription, model: ObjectModel, pose: Array, grips: Grips, access: Array
) -> Array:
    """Tool poses ``(n, 7)`` that hold an object, come in the direction of its place.

    Args:
        robot: The robot.
        model: The object.
        pose: Its pose ``(7,)``, robot base frame.
        grips: Where it may be held.
        access: Unit vector ``(3,)`` along which hands come, robot base frame.
    """
    found = []
    half = float(np.abs(poses.rotate(poses.quat_conjugate(pose[3:]), access)) @ model.extent) / 2
    deep = max(half - robot.depth, 0.0)
    turns = [k * math.pi / TURNS for k in range(TURNS)] if model.symmetry == 0 else [0.0]
    for point, closing, width in zip(grips.points, grips.closing, grips.widths, strict=True):
        if not fits_between(width, robot.opening):
            continue
        for turn in turns:
            about = poses.yaw(turn)
            axis = poses.rotate(pose[3:], poses.rotate(about, closing))
            if abs(float(axis @ access)) > ACROSS:
                continue
            along = access - (axis @ access) * axis
            at = poses.transform(pose, poses.rotate(about, point))
            at = at - max(deep - float((pose[:3] - at) @ access), 0.0) * access
            along = along / np.linalg.norm(along)
            found += [poses.pose(at, poses.frame_from_axes(along, side)) for side in (axis, -axis)]
    return np.array(found).reshape(-1, 7)


def _at_goal(robot: RobotDescription, actor: ObjectActor, place: PlaceModel) -> Array:
    """Tool poses ``(n, 7)`` that hold an object standing at a place's origin, whatever its heading."""
    size = ShapeSize(actor.known_size or actor.size, actor.exponents, actor.mesh)
    height, model, grips = resting_height(actor.kind, size), actor.model(), grips_of(actor)
    out = []
    for k in range(TURNS):
        local = poses.pose([0.0, 0.0, height], poses.yaw(2 * math.pi * k / TURNS))
        out.append(tool_poses(robot, model, poses.multiply(place.pose, local), grips, place.access))
    return np.concatenate(out)


def _passed(goal: Goal, place: PlaceModel) -> bool:
    """A mark that the object only has to have been on, as it goes over it."""
    return goal.when == "once" and place.kind == "spot"


def _fits(model: ObjectModel, place: PlaceModel) -> bool:
    """A place has room for an object, turned as it may be, below what is above it."""
    footprint, room = sorted(model.extent[:2]), sorted(place.extent)
    low = place.container or place.height <= 0.0 or model.extent[2] <= place.height
    return low and footprint[0] <= room[0] and footprint[1] <= room[1]


def _any_reached(robot: RobotDescription, asked: Array) -> bool:
    """The arm reaches one of these tool poses ``(k, 7)``, within its workspace if it has one."""
    if robot.safety is not None:
        asked = asked[robot.safety.in_workspace(asked[:, :3])]
    if not len(asked):
        return False
    _, failures = _kinematics(robot, len(asked)).joints_at(asked)
    return not failures.mask.all()


def _kinematics(robot: RobotDescription, n: int) -> BatchKinematics:
    from bt_tasksim.engines.kinematics.batch import BatchKinematics

    return BatchKinematics.of(robot, n)


def _actor(world: ActorConfiguration, name: str) -> ObjectActor:
    return next(actor for actor in world.objects if actor.name == name)


def _place(world: ActorConfiguration, name: str) -> PlaceModel:
    return next(place for place in world.places if place.name == name)


def _takes(robot: RobotDescription) -> str:
    """What its hand takes."""
    wide, least = 1000 * robot.opening, 1000 * (robot.opening - WIDER)
    return f"the hand of {robot.name}, which opens to {wide:.0f} mm, takes less than {least:.0f} mm"


def _ahead(robot: RobotDescription) -> str:
    """Where the tool is at rest, from above."""
    from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics

    x, y = robot.derived("tool at rest", lambda r: PinocchioKinematics(r).forward(r.rest))[:2]
    return f"where the tool of {robot.name} rests (x {x:.2f} y {y:.2f} m)"


def _said(access: Array) -> str:
    """``above`` or ``the front, 35 degrees from above``."""
    angle = math.degrees(math.acos(min(1.0, max(-1.0, -float(access[2])))))
    return "above" if angle < 1.0 else f"{angle:.0f} degrees from above"
