"""The way to where a run begins: slow, watched, and with the hand taken along."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import JointTarget
from bt_tasksim.hardware.ros.setting import RosSetting
from bt_tasksim.hardware.safety.engine import JointReading
from bt_tasksim.hardware.safety.motion import approach
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.limits import SafetyLimits

if TYPE_CHECKING:
    from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics

PERIOD = 0.05
"""Seconds between two commands."""
STILL = (0.02, 0.03)
"""Speed (rad/s) and distance (rad) within which the arm stands where a run begins."""
SETTLE = 5.0
"""Seconds within which it must, once it has been told to be there."""
LONGEST = 60.0
"""Seconds that the way there may take."""
HAND = 0.25
"""Share of the hand's range by which a joint of it may be off there."""


class WayToStart:
    """Brings an arm to where a run begins.

    Args:
        robot: The robot.
        limits: Its limits.
        setting: The share of them that the way may take, and names for sentences.
        kinematics: For the tool's pose.
        checked: The newest joint states, or an error where nothing may move.
        send: Takes a command, the seconds until the next one, and those that the hand may take.
    """

    def __init__(
        self,
        robot: RobotDescription,
        limits: SafetyLimits,
        setting: RosSetting,
        kinematics: PinocchioKinematics,
        checked: Callable[[], JointReading],
        send: Callable[[JointTarget, float, float], None],
    ) -> None:
        self._robot, self._limits, self._setting, self._kinematics = robot, limits, setting, kinematics
        self._checked, self._send = checked, send

    def go(self, goal: Array, heartbeat: Callable[[], None]) -> None:
        """Go there and wait until the arm stands.

        Args:
            goal: Where the joints are to be ``(n_joints,)``.
            heartbeat: Called before every command, for whoever watches.

        Raises:
            InputError: The tool may not be there.
            MachineError: The arm does not follow, or was stopped.
        """
        n = len(self._robot.arm_joints)
        self._check_posture(goal)
        start = self._begin_hand(heartbeat)
        speed, acceleration = self._gentle()
        motions = approach(start, goal, speed, acceleration, PERIOD)
        way = list(itertools.islice(motions, int(LONGEST / PERIOD)))
        if next(motions, None) is not None:
            k = int(np.argmax(np.abs(start - goal) / speed))
            raise MachineError(
                f"the way to the start would take more than {LONGEST:g} s: {self._robot.joints[k]} is "
                f"{abs(start[k] - goal[k]):.2f} away; is 'approach' in '{self._setting.source}' too small?"
            )
        following = time.monotonic()
        for motion in way:
            following = max(following, time.monotonic())  # what was late is not made up for
            heartbeat()
            self._send(JointTarget(motion.position, motion.velocity, self._limits.validity), PERIOD, PERIOD)
            following += PERIOD
            time.sleep(max(following - time.monotonic(), 0.0))
            off = np.abs(self._checked().position - motion.position)[:n]
            if np.any(off > self._limits.tracking):
                raise self._astray(
                    int(np.argmax(off)), float(off.max()), "does not follow the way to its start"
                )
        end = time.monotonic() + SETTLE
        while True:
            heartbeat()
            reading = self._checked()
            off = np.abs(reading.position - goal)[:n]
            if np.all(off < STILL[1]) and np.all(np.abs(reading.velocity[:n]) < STILL[0]):
                return self._check_hand(reading.position - goal)
            if time.monotonic() > end:
                raise self._astray(
                    int(np.argmax(off)), float(off.max()), "does not come to stand at its start"
                )
            time.sleep(0.02)

    def _check_posture(self, goal: Array) -> None:
        """The tool of a run that begins may not be where the guard would stop the run at once.

        Raises:
            InputError: It is.
        """
        tool, limits = self._kinematics.forward(goal)[:3], self._limits
        if not limits.in_workspace(tool):
            at = ", ".join(f"{x:.2f}" for x in tool)
            raise InputError(
                f"a run would begin with the tool at ({at}), outside of safety.workspace: change that or the "
                f"rest posture in '{self._robot.source}'"
            )

    def _begin_hand(self, heartbeat: Callable[[], None]) -> Array:
        """Have the hand's controller follow from where the hand is, and say where everything is.

        It may have been told to close on something that is in the way, and what is commanded next must not be
        a jump for it; so it gets the time for its whole way, while the arm stands.
        """
        n, (low, high) = len(self._robot.arm_joints), self._robot.hand_range
        start = self._checked().position.copy()
        start[n:] = np.clip(start[n:], low, high)
        stand = JointTarget(start, np.zeros_like(start), self._limits.validity)
        for k in reversed(range(math.ceil(1.0 / (self._robot.hand_speed * PERIOD)))):
            heartbeat()
            self._send(stand, PERIOD, (k + 1) * PERIOD)
            time.sleep(PERIOD)
            self._checked()
        return start

    def _check_hand(self, off: Array) -> None:
        """The hand has come to its start, too.

        Raises:
            MachineError: A joint is far from there.
        """
        n, (low, high) = len(self._robot.arm_joints), self._robot.hand_range
        share = np.abs(off[n:]) / np.max(high - low)
        if np.any(share > HAND):
            k = int(np.argmax(share))
            name, far = self._robot.joints[n + k], abs(off[n + k])
            raise MachineError(
                f"the hand does not come to its start: {name} is {far:.3f} away; is the controller of "
                f"'{self._setting.hand.command}' active?"
            )

    def _gentle(self) -> tuple[Array, Array]:
        """Speeds and accelerations ``(n_joints,)`` of the way to the start."""
        robot, share = self._robot, self._setting.approach
        low, high = robot.hand_range
        span = np.maximum(high - low, 0.1 * np.max(high - low)) * robot.hand_speed  # some joints only follow
        speed = np.concatenate([self._limits.velocity, span])
        acceleration = np.concatenate([self._limits.acceleration, span / 0.1])
        return share * speed, share * acceleration

    def _astray(self, joint: int, off: float, what: str) -> MachineError:
        name = self._robot.joints[joint]
        return MachineError(
            f"the arm {what}: {name} is {off:.2f} rad away; is the controller of "
            f"'{self._setting.arm.command}' active?"
        )
