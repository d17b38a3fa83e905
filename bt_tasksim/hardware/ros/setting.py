"""The ROS side of a robot's cell, read from a file: topics, joint names on the wire, frames, cameras."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.document import located
from bt_tasksim.core.errors import FieldError, InputError, nearest
from bt_tasksim.core.poses import Array
from bt_tasksim.core.resources import asset
from bt_tasksim.core.typed_file import load_typed
from bt_tasksim.hardware.ros.schema import (
    NAME,
    TOPIC,
    CameraTopicsEntry,
    CellFile,
    GroupEntry,
    TipEffort,
    TipTopics,
)
from bt_tasksim.robot.description import RobotDescription


@dataclass(frozen=True)
class Group:
    """Joints that one controller moves.

    Attributes:
        command: Topic of its trajectories.
        joints: Names on the wire, in the robot's order.
    """

    command: str
    joints: tuple[str, ...]


@dataclass(frozen=True)
class Stamped:
    """A topic whose messages name a frame."""

    topic: str
    frame: str


@dataclass(frozen=True)
class Sensor(Stamped):
    """A sensor of forces and its pose ``(7,)`` in the tool frame."""

    pose: Array


@dataclass(frozen=True)
class TipSignals:
    """What is felt at the fingertips.

    Attributes:
        topics: Topic of each tip, in the robot's order; empty where contact follows from the drives' effort.
        frame: Frame of these messages.
        effort: Of a hand joint, N or Nm, from which its tip counts as pressing; where there are no topics.
    """

    topics: tuple[str, ...]
    frame: str
    effort: float


@dataclass(frozen=True)
class CameraTopics:
    """A camera: topics of colour, depth and calibration, and the pose ``(7,)`` of its optical frame."""

    colour: str
    depth: str
    info: str
    pose: Array


@dataclass(frozen=True)
class RosSetting:
    """The ROS side of a robot's cell.

    Attributes:
        robot: Name of the robot.
        joint_states: Topic of the joint states.
        wire: Every joint that they name, in their order.
        order: Index ``(n_joints,)`` into ``wire`` of each of the robot's joints.
        arm: The arm's controller.
        hand: The hand's.
        wrench: The wrist's sensor.
        tips: The fingertips.
        objects: Topic of an object's pose with ``{name}`` in it, and its frame; None where none is tracked.
        emergency_stop: Topic.
        emergency_every: Longest time in seconds between two of its messages; infinite where it speaks on a
            change alone, so that nobody can tell a topic that is mute from one that has nothing to say.
        begin: Topic that says that a run begins; empty where the cell has none.
        hold: Topic that says hold; empty where the cell has none.
        approach: Share of the robot's speeds with which it goes to where a run starts.
        cameras: By name.
        source: The file.
    """

    robot: str
    joint_states: str
    wire: tuple[str, ...]
    order: Array
    arm: Group
    hand: Group
    wrench: Sensor
    tips: TipSignals
    objects: Stamped | None
    emergency_stop: str
    emergency_every: float
    begin: str
    hold: str
    approach: float
    cameras: Mapping[str, CameraTopics]
    source: Path

    def object_topics(self, names: Iterable[str]) -> list[str]:
        """Topics of objects' poses; none where nobody tracks them.

        Raises:
            InputError: A name makes no topic.
        """
        return [] if self.objects is None else [self.object_topic(name) for name in names]

    def object_topic(self, name: str) -> str:
        """Topic of an object's pose.

        Raises:
            InputError: There is no tracking system, or the name makes no topic.
        """
        if self.objects is None:
            raise InputError(
                f"'{self.source}' names no topic for the poses of objects: use --perception camera"
            )
        topic = self.objects.topic.replace(NAME, name)
        if not TOPIC.fullmatch(topic):
            raise InputError(
                f"the topic of object '{name}' should be one such as '/arm/state' (letters, digits, _), "
                f"found {topic!r}"
            )
        return topic


def load_setting(robot: RobotDescription, file: str = "") -> RosSetting:
    """The ROS side of a robot.

    Args:
        robot: The robot.
        file: Path of the file; by default the bundled one of the robot's name.

    Raises:
        InputError: There is none, or it lacks or misstates something.
    """
    path = Path(file).resolve() if file else asset("robots", "ros", f"{robot.name}.yaml")
    if not path.is_file():
        if file:
            raise InputError(f"no file '{file}' for the robot's ROS side")
        known = [p.stem for p in asset("robots", "ros").glob("*.yaml")]
        raise InputError(
            f"no file says how '{robot.name}' speaks ROS{nearest(robot.name, known)}; write one as "
            f"docs/connect_a_robot.md shows, and name it with --ros FILE"
        )
    content, document = load_typed(CellFile, path, "ROS file")
    with located(document):
        return _setting(content, robot, path)


def _setting(data: CellFile, robot: RobotDescription, path: Path) -> RosSetting:
    if data.robot != robot.name:
        raise FieldError(f"it is for robot '{data.robot}', and the robot is '{robot.name}'", "robot")
    wire = data.joint_states.joints
    if len(set(wire)) < len(wire):
        raise FieldError("'joint_states.joints' names a joint twice", "joint_states", "joints")
    arm = _group(data.arm, "arm", robot.arm_joints, wire)
    hand = _group(data.hand, "hand", robot.hand_joints, wire)
    if both := set(arm.joints) & set(hand.joints):
        raise FieldError(f"'{sorted(both)[0]}' is in 'arm.joints' and in 'hand.joints'", "hand", "joints")
    if data.hold and not data.begin:
        raise FieldError("'hold' needs 'begin' beside it: without a new run nothing would end a hold", "hold")
    stop = data.emergency_stop
    setting = RosSetting(
        robot=robot.name,
        joint_states=data.joint_states.topic,
        wire=wire,
        order=np.array([wire.index(name) for name in arm.joints + hand.joints]),
        arm=arm,
        hand=hand,
        wrench=Sensor(data.wrench.topic, data.wrench.frame, poses.unit_pose(data.wrench.pose)),
        tips=_tips(data.tips, robot),
        objects=None if data.objects is None else Stamped(data.objects.topic, data.objects.frame),
        emergency_stop=stop if isinstance(stop, str) else stop.topic,
        emergency_every=math.inf if isinstance(stop, str) else stop.every,
        begin=data.begin or "",
        hold=data.hold or "",
        approach=data.approach,
        cameras={name: _camera(camera) for name, camera in (data.cameras or {}).items()},
        source=path,
    )
    _no_topic_twice(setting)
    return setting


def _group(data: GroupEntry, what: str, own: tuple[str, ...], wire: tuple[str, ...]) -> Group:
    joints, n = data.joints, len(own)
    if len(joints) != n or len(set(joints)) != n:
        raise FieldError(
            f"'{what}.joints' should name the {n} joints of the robot's {what}, found {list(joints)}",
            what,
            "joints",
        )
    for i, name in enumerate(joints):
        if name not in wire:
            raise FieldError(
                f"'{what}.joints' names '{name}', which 'joint_states.joints' lacks{nearest(name, wire)}",
                *(what, "joints", i),
            )
    for i, (name, here) in enumerate(zip(joints, own, strict=True)):
        if name != here and name in own:
            raise FieldError(
                f"'{what}.joints' has the robot's joints in another order, '{name}' where '{here}' should "
                "be: the n-th name here is the n-th joint of the robot's file",
                *(what, "joints", i),
            )
    return Group(data.command, joints)


def _tips(data: TipTopics | TipEffort, robot: RobotDescription) -> TipSignals:
    if isinstance(data, TipEffort):
        return TipSignals((), "", data.effort)
    known = [tip.name for tip in robot.tips]
    for name in data.topics:
        if name not in known:
            said = f"unknown field 'tips.topics.{name}'{nearest(name, known)}"
            raise FieldError(said, "tips", "topics", name)
    for name in known:
        if name not in data.topics:
            raise FieldError(f"'tips.topics.{name}' is missing", "tips", "topics")
    return TipSignals(tuple(data.topics[name] for name in known), data.frame, 0.0)


def _camera(data: CameraTopicsEntry) -> CameraTopics:
    return CameraTopics(data.colour, data.depth, data.info, poses.unit_pose(data.pose))


def _no_topic_twice(setting: RosSetting) -> None:
    topics = [setting.joint_states, setting.arm.command, setting.hand.command, setting.wrench.topic]
    topics += [*setting.tips.topics, setting.emergency_stop, setting.begin, setting.hold]
    for camera in setting.cameras.values():
        topics += [camera.colour, camera.depth, camera.info]
    seen: set[str] = set()
    for topic in filter(None, topics):
        if topic in seen:
            raise InputError(f"the topic '{topic}' is named twice")
        seen.add(topic)
