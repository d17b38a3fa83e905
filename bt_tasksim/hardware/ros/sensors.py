"""What a cell's sensors say beside the joints: forces, and where tracked objects are; the newest of each."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.hardware.ros import messages
from bt_tasksim.hardware.ros.link import Link
from bt_tasksim.hardware.ros.setting import RosSetting
from bt_tasksim.robot.description import RobotDescription

STALE = 0.3
"""Seconds after which forces are too old to act on; joint states and the wrench have a limit of their own."""
UNSEEN = 1.0
"""Seconds after which a tracked object counts as lost."""


@dataclass(frozen=True, slots=True)
class Newest:
    """The newest value of a topic, and when it was measured, seconds of `time.monotonic`."""

    value: Array
    stamp: float


class Sensors:
    """Wrench, forces at the fingertips, and tracked objects.

    Attributes:
        objects: Names of the tracked ones.
        newest: The newest message of each topic.

    Args:
        robot: The robot.
        setting: Topics and frames.
        convert: From a message's stamp and when it arrived to seconds of `time.monotonic`.
    """

    def __init__(
        self, robot: RobotDescription, setting: RosSetting, convert: Callable[[float, float], float]
    ) -> None:
        self._robot, self._setting, self._convert = robot, setting, convert
        self.objects: tuple[str, ...] = ()
        self.newest: dict[str, Newest] = {}

    def forget(self) -> None:
        """Only what arrives from now on counts."""
        self.newest = {}

    def listen(self, link: Link, objects: tuple[str, ...]) -> None:
        """Subscribe to every topic, with those of these objects."""
        setting, self.objects = self._setting, objects
        force, pose = "geometry_msgs/WrenchStamped", "geometry_msgs/PoseStamped"
        self._listen(link, setting.wrench.topic, force, messages.wrench, setting.wrench.frame)
        for topic in setting.tips.topics:
            self._listen(link, topic, force, messages.wrench, setting.tips.frame)
        for name in objects:
            assert setting.objects is not None
            self._listen(link, setting.object_topic(name), pose, messages.pose, setting.objects.frame)

    def _listen(
        self, link: Link, topic: str, kind: str, read: Callable[[Any, str], tuple[Array, float]], frame: str
    ) -> None:
        def handle(message: Any, arrived: float) -> None:
            value, stamp = read(message, frame)
            self.newest[topic] = Newest(value, self._convert(stamp, arrived))

        link.subscribe(topic, kind, handle)

    def silent(self) -> list[str]:
        """Topics on which nothing usable has come for a while."""
        setting, now = self._setting, time.monotonic()
        wanted = [setting.wrench.topic, *setting.tips.topics, *map(setting.object_topic, self.objects)]
        found = ((topic, self.newest.get(topic)) for topic in wanted)
        return [topic for topic, newest in found if newest is None or now - newest.stamp > STALE]

    def wrench(self, oldest: float) -> Array:
        """The external wrench ``(6,)`` at the tool, tool frame.

        Raises:
            MachineError: It is older than so many seconds.
        """
        sensor = self._setting.wrench
        return messages.in_tool_frame(self._fresh(sensor.topic, oldest), sensor.pose)

    def tip_force(self, effort: Array) -> Array:
        """Forces ``(n_tips, 3)`` in newtons: as felt, or of the drives' size where there are no sensors.

        Args:
            effort: The drives' ``(n_joints,)``.

        Raises:
            MachineError: They are too old.
        """
        tips = self._setting.tips
        if tips.topics:
            return np.array([self._fresh(topic, STALE)[:3] for topic in tips.topics])
        n = len(self._robot.tips)
        felt = np.abs(effort[len(self._robot.arm_joints) :])
        felt = felt if len(felt) == n else np.full(n, felt.max())
        out = np.zeros((n, 3))
        out[:, 2] = np.where(felt >= tips.effort, felt, 0.0)
        return out

    def poses(self) -> Array:
        """Poses ``(n_objects, 7)`` of the tracked objects.

        Raises:
            MachineError: One was not heard of for too long.
        """
        found = [self._fresh(self._setting.object_topic(name), UNSEEN) for name in self.objects]
        return np.array(found).reshape(len(found), 7)

    def _fresh(self, topic: str, oldest: float) -> Array:
        newest, now = self.newest.get(topic), time.monotonic()
        if newest is None:
            raise MachineError(f"nothing has come on {topic}")
        if now - newest.stamp > oldest:
            raise MachineError(f"stale: nothing usable on {topic} for {1000 * (now - newest.stamp):.0f} ms")
        return newest.value
