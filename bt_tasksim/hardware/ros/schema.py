"""What may stand in the file of the ROS side of a robot's cell."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import AfterValidator, Discriminator, Field, Tag

from bt_tasksim.core.typed_file import Model, Name, Number, Pose7, Positive, Text

TOPIC = re.compile(r"/[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
NAME = "{name}"
"""What stands for an object's name in a topic."""
IDENTITY = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


def _topic(value: str) -> str:
    if not TOPIC.fullmatch(value):
        raise ValueError("should be a topic such as '/arm/state' (letters, digits, _)")
    return value


def _object_topic(value: str) -> str:
    if value.count(NAME) != 1:
        raise ValueError(f"should hold '{NAME}' once")
    _topic(value.replace(NAME, "x"))
    return value


def _text_or_entry(value: object) -> str:
    return "~text" if isinstance(value, str) else "~entry"


def _tips(value: object) -> str:
    return "~effort" if isinstance(value, dict) and "effort" in value else "~topics"


Topic = Annotated[Text, AfterValidator(_topic)]
Joints = Annotated[tuple[Text, ...], Field(strict=False, min_length=1, max_length=256)]
Frame = Annotated[str, Field(min_length=1, max_length=200)]


class JointStatesEntry(Model):
    """Joint states, sensor_msgs/JointState."""

    topic: Topic
    """Their topic."""
    joints: Joints
    """Every joint that they name, in their order."""


class GroupEntry(Model):
    """Joints that one controller moves."""

    command: Topic
    """Topic of its trajectories, trajectory_msgs/JointTrajectory."""
    joints: Joints
    """Names on the wire, in the robot's order."""


class SensorEntry(Model):
    """The wrist's sensor, geometry_msgs/WrenchStamped, the hand's own weight removed."""

    topic: Topic
    """Its topic."""
    frame: Frame
    """Frame that its messages name."""
    pose: Pose7 = IDENTITY
    """Position (m) and unit quaternion w x y z of the sensor in the tool frame."""


class TipTopics(Model):
    """Fingertips with sensors, geometry_msgs/WrenchStamped each."""

    frame: Frame
    """Frame that their messages name."""
    topics: Annotated[dict[Name, Topic], Field(max_length=32)]
    """Topic by fingertip."""


class TipEffort(Model):
    """Fingertips without sensors."""

    effort: Positive
    """Of a hand joint, N or Nm, from which its tip counts as pressing."""


class ObjectTopic(Model):
    """Objects' poses from a tracking system, geometry_msgs/PoseStamped."""

    topic: Annotated[Text, AfterValidator(_object_topic)]
    """Topic with `{name}` in the place of an object's name."""
    frame: Frame
    """Frame that its messages name."""


class StopEntry(Model):
    """The emergency stop, std_msgs/Bool."""

    topic: Topic
    """Its topic."""
    every: Positive
    """Longest silence, s, after which the arm holds."""


class CameraTopicsEntry(Model):
    """A camera."""

    colour: Topic
    """Compressed colour pictures."""
    depth: Topic
    """Compressed depth pictures."""
    info: Topic
    """Calibration."""
    pose: Pose7
    """Position (m) and unit quaternion w x y z of its optical frame in the robot base frame."""


class CellFile(Model):
    """The ROS side of a robot's cell: topics, names on the wire, frames, cameras."""

    robot: Text
    """Name of the robot."""
    joint_states: JointStatesEntry
    """Where its joint states come from."""
    arm: GroupEntry
    """The arm's controller."""
    hand: GroupEntry
    """The hand's controller."""
    wrench: SensorEntry
    """The wrist's sensor."""
    tips: Annotated[
        Annotated[TipTopics, Tag("~topics")] | Annotated[TipEffort, Tag("~effort")], Discriminator(_tips)
    ]
    """The fingertips: topics of their sensors, or the effort from which they count as pressing."""
    objects: ObjectTopic | None = None
    """The tracking system; without it objects are seen by cameras."""
    emergency_stop: Annotated[
        Annotated[Topic, Tag("~text")] | Annotated[StopEntry, Tag("~entry")], Discriminator(_text_or_entry)
    ]
    """The emergency stop: its topic, or the topic and how often it speaks."""
    begin: Topic | None = None
    """Topic that says that a run begins, std_msgs/String."""
    hold: Topic | None = None
    """Topic that says hold, std_msgs/String."""
    approach: Annotated[Number, Field(gt=0.0, le=1.0)] = 0.3
    """Share of the robot's speeds with which it goes to where a run starts."""
    cameras: Annotated[dict[Name, CameraTopicsEntry], Field(max_length=16)] | None = None
    """Cameras by name."""
