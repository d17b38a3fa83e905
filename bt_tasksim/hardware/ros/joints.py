"""Joint states of a robot's cell: from messages to readings in the robot's order and this machine's time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bt_tasksim.hardware.ros import messages
from bt_tasksim.hardware.ros.messages import UnusableMessageError
from bt_tasksim.hardware.ros.setting import RosSetting
from bt_tasksim.hardware.safety.engine import JointReading, RobotClock
from bt_tasksim.robot.description import RobotDescription


class JointFeed:
    """The newest joint states, and the cell's clock as they tell it.

    They alone do: a stranger's stamp on another topic must not make every joint state look old.

    Attributes:
        newest: None before the first ones.
        heard: Names on the wire, as the newest ones have them.
        offset: Seconds from the cell's clock to this machine's `time.monotonic`, the shortest delay of a
            message included; infinite before the first ones.

    Args:
        robot: The robot.
        setting: Names on the wire.
    """

    def __init__(self, robot: RobotDescription, setting: RosSetting) -> None:
        self._robot, self._setting = robot, setting
        self._names = dict(zip(setting.arm.joints + setting.hand.joints, robot.joints, strict=True))
        self.anew()

    def anew(self) -> None:
        """A new connection: its delays are others."""
        self._clock, self.offset = RobotClock(), math.inf
        self.forget()

    def forget(self) -> None:
        """Only what arrives from now on counts."""
        self.newest: JointReading | None = None
        self.heard: tuple[str, ...] = ()
        self._stamp = -math.inf

    def convert(self, stamp: float, arrived: float) -> float:
        """When a message of another topic was measured: never after it arrived.

        Args:
            stamp: Seconds of the cell's clock.
            arrived: Seconds of `time.monotonic`.
        """
        return min(stamp + self.offset, arrived)

    def take(self, message: Any, arrived: float) -> None:
        """Take joint states, in the robot's order and names where the wire's are as its file says.

        Args:
            message: A sensor_msgs/JointState.
            arrived: Seconds of `time.monotonic`.

        Raises:
            UnusableMessageError: They are none, or not newer than the last ones.
        """
        came, setting = messages.joint_states(message), self._setting
        if came.stamp <= self._stamp:
            behind = 1000.0 * (self._stamp - came.stamp)
            raise UnusableMessageError(
                f"joint states: stamped {behind:.0f} ms before the last ones, not after them"
            )
        stamp = self._clock.convert(came.stamp, arrived)
        self._stamp, self.offset, self.heard = came.stamp, stamp - came.stamp, came.names
        if came.names == setting.wire:
            order, names = setting.order, self._robot.joints
        else:  # the guard says what is wrong with them
            order = np.arange(len(came.names))
            names = tuple(self._names.get(name, name) for name in came.names)
        position, velocity = came.position[order], came.velocity[order]
        before = self.newest
        if before is not None and before.names == names and np.all(np.isnan(velocity)):
            elapsed = stamp - before.stamp
            velocity = (position - before.position) / elapsed if elapsed > 1e-4 else before.velocity
        elif np.all(np.isnan(velocity)):
            velocity = np.zeros_like(position)
        self.newest = JointReading(names, position, velocity, stamp, came.effort[order])
