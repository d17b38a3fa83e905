"""The ROS side of a robot's cell, read from a file: topics, joint names on the wire, frames, cameras."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from bt_tasksim.data_file import check_keys, names, positive, vector
from bt_tasksim.errors import InputError, nearest
from bt_tasksim.poses import Array
from bt_tasksim.resources import asset
from bt_tasksim.robot import RobotDescription

_TOPIC = re.compile(r"/[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
_NAME = "{name}"


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
class Tips:
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
    tips: Tips
    objects: Stamped | None
    emergency_stop: str
    emergency_every: float
    begin: str
    hold: str
    approach: float
    cameras: Mapping[str, CameraTopics]
    source: Path

    def object_topic(self, name: str) -> str:
        """Topic of an object's pose.

        Raises:
            InputError: There is no tracking system, or the name makes no topic.
        """
        if self.objects is None:
            raise InputError(
                f"'{self.source}' names no topic for the poses of objects: use --perception camera"
            )
        return _topic(self.objects.topic.replace(_NAME, name), f"the topic of object '{name}'")


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
    try:
        data = yaml.safe_load(path.read_text())
        check_keys(data, "", _KEYS, _OPTIONAL)
        return _setting(data, robot, path)
    except yaml.YAMLError as error:
        raise InputError(f"ROS file '{path}' is not YAML: {' '.join(str(error).split())}") from error
    except (InputError, TypeError, ValueError, AttributeError, OSError) as error:
        raise InputError(f"ROS file '{path}': {error}") from error


_KEYS: Mapping[str, Any] = {
    "robot": None,
    "joint_states": {"topic": None, "joints": None},
    "arm": {"command": None, "joints": None},
    "hand": {"command": None, "joints": None},
    "wrench": {"topic": None, "frame": None},
    "tips": None,
    "emergency_stop": None,
}
_OPTIONAL: Mapping[str, Any] = {
    **dict.fromkeys(("objects", "begin", "hold", "approach", "cameras")),
    "wrench": {"pose": None},
}


def _setting(data: Mapping[str, Any], robot: RobotDescription, path: Path) -> RosSetting:
    if data["robot"] != robot.name:
        raise InputError(f"it is for robot '{data['robot']}', and the robot is '{robot.name}'")
    wire = names(data["joint_states"]["joints"], "joint_states.joints")
    if len(set(wire)) < len(wire):
        raise InputError("joint_states.joints names a joint twice")
    arm = _group(data["arm"], "arm", robot.arm_joints, wire)
    hand = _group(data["hand"], "hand", robot.hand_joints, wire)
    if both := set(arm.joints) & set(hand.joints):
        raise InputError(f"'{sorted(both)[0]}' is in arm.joints and in hand.joints")
    approach = positive(data.get("approach", 0.3), "approach")
    if approach > 1.0:
        raise InputError(f"approach should be a share of at most 1, found {approach:g}")
    objects = data.get("objects")
    stop, every = _emergency_stop(data["emergency_stop"])
    setting = RosSetting(
        robot=robot.name,
        joint_states=_topic(data["joint_states"]["topic"], "joint_states.topic"),
        wire=wire,
        order=np.array([wire.index(name) for name in arm.joints + hand.joints]),
        arm=arm,
        hand=hand,
        wrench=_sensor(data["wrench"], "wrench"),
        tips=_tips(data["tips"], robot),
        objects=None if objects is None else _objects(objects),
        emergency_stop=stop,
        emergency_every=every,
        begin=_topic(data["begin"], "begin") if data.get("begin") else "",
        hold=_topic(data["hold"], "hold") if data.get("hold") else "",
        approach=approach,
        cameras={str(k): _camera(v, f"cameras.{k}") for k, v in (data.get("cameras") or {}).items()},
        source=path,
    )
    if setting.hold and not setting.begin:
        raise InputError("'hold' needs 'begin' beside it: without a new run nothing would end a hold")
    _no_topic_twice(setting)
    return setting


def _group(data: Mapping[str, Any], what: str, own: tuple[str, ...], wire: tuple[str, ...]) -> Group:
    joints, n = names(data["joints"], f"{what}.joints"), len(own)
    if len(joints) != n or len(set(joints)) != n:
        raise InputError(
            f"{what}.joints should name the {n} joints of the robot's {what}, found {list(joints)}"
        )
    for name in joints:
        if name not in wire:
            raise InputError(
                f"{what}.joints names '{name}', which joint_states.joints lacks{nearest(name, wire)}"
            )
    for name, here in zip(joints, own, strict=True):
        if name != here and name in own:
            raise InputError(
                f"{what}.joints has the robot's joints in another order, '{name}' where '{here}' should be: "
                "the n-th name here is the n-th joint of the robot's file"
            )
    return Group(_topic(data["command"], f"{what}.command"), joints)


def _tips(data: Any, robot: RobotDescription) -> Tips:
    if isinstance(data, dict) and "effort" in data:
        check_keys(data, "tips.", {"effort": None})
        return Tips((), "", positive(data["effort"], "tips.effort"))
    check_keys(data, "tips.", {"frame": None, "topics": dict.fromkeys(tip.name for tip in robot.tips)})
    topics = tuple(_topic(data["topics"][tip.name], f"tips.topics.{tip.name}") for tip in robot.tips)
    return Tips(topics, _frame(data["frame"], "tips.frame"), 0.0)


def _emergency_stop(data: Any) -> tuple[str, float]:
    """Its topic, and how often it speaks (`RosSetting.emergency_every`)."""
    if not isinstance(data, dict):
        return _topic(data, "emergency_stop"), math.inf
    check_keys(data, "emergency_stop.", {"topic": None, "every": None})
    every = positive(data["every"], "emergency_stop.every")
    return _topic(data["topic"], "emergency_stop.topic"), every


def _objects(data: Any) -> Stamped:
    check_keys(data, "objects.", {"topic": None, "frame": None})
    topic = data["topic"]
    if not isinstance(topic, str) or topic.count(_NAME) != 1:
        raise InputError(f"objects.topic should hold '{_NAME}' once, found {topic!r}")
    _topic(topic.replace(_NAME, "x"), "objects.topic")
    return Stamped(topic, _frame(data["frame"], "objects.frame"))


def _sensor(data: Mapping[str, Any], what: str) -> Sensor:
    pose = _pose(data.get("pose", [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), f"{what}.pose")
    return Sensor(_topic(data["topic"], f"{what}.topic"), _frame(data["frame"], f"{what}.frame"), pose)


def _camera(data: Any, what: str) -> CameraTopics:
    check_keys(data, f"{what}.", dict.fromkeys(("colour", "depth", "info", "pose")))
    colour, depth, info = (_topic(data[key], f"{what}.{key}") for key in ("colour", "depth", "info"))
    return CameraTopics(colour, depth, info, _pose(data["pose"], f"{what}.pose"))


def _pose(values: Any, what: str) -> Array:
    pose = np.array(vector(values, 7, what))
    length = float(np.linalg.norm(pose[3:]))
    if abs(length - 1.0) > 1e-3:
        raise InputError(f"{what} should end with a unit quaternion (w x y z), found {values!r}")
    pose[3:] /= length
    return pose


def _topic(value: Any, what: str) -> str:
    if not isinstance(value, str) or not _TOPIC.fullmatch(value):
        raise InputError(
            f"{what} should be a topic such as '/arm/state' (letters, digits, _), found {value!r}"
        )
    return value


def _frame(value: Any, what: str) -> str:
    if not isinstance(value, str) or not value:
        raise InputError(f"{what} should be the name of a frame, found {value!r}")
    return value


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
