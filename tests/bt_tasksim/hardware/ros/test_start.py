"""The way to where a run begins, with an arm that is at once where it is told to be."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np
import pytest

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.world import JointTarget
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.hardware.ros.setting import load_setting
from bt_tasksim.hardware.ros.start import PERIOD, WayToStart
from bt_tasksim.hardware.safety.engine import JointReading
from bt_tasksim.robot.description import load_robot

ROBOT = load_robot("panda")
KINEMATICS = PinocchioKinematics(ROBOT)
START = np.concatenate([ROBOT.rest, ROBOT.hand_open])
SETTING = load_setting(ROBOT)


class Arm:
    """Goes where it is told at once, as its hand does.

    Attributes:
        sent: What it was told, the seconds that its hand may take, and when.
        lag: What it adds to where it was told to be ``(7,)``.
        stall: Seconds that its fourth answer takes.
        hand: The hand follows; else it stays where it is.
    """

    def __init__(self, lag: float = 0.0, stall: float = 0.0, hand: bool = True) -> None:
        self.position, self.sent = START.copy(), list[tuple[JointTarget, float, float]]()
        self.lag, self.stall, self.hand, self._asked = lag, stall, hand, 0

    def checked(self) -> JointReading:
        self._asked += 1
        time.sleep(self.stall * (self._asked == 4))
        still = np.zeros_like(self.position)
        return JointReading(ROBOT.joints, self.position.copy(), still, time.monotonic())

    def send(self, target: JointTarget, period: float, hand_takes: float) -> None:
        assert period == PERIOD and target.validity == ROBOT.safety.validity
        self.sent.append((target, hand_takes, time.monotonic()))
        self.position[:7] = target.position[:7] + self.lag
        if self.hand:
            self.position[7:] = target.position[7:]

    def way(self, limits: Any = ROBOT.safety, setting: Any = SETTING) -> WayToStart:
        return WayToStart(ROBOT, limits, setting, KINEMATICS, self.checked, self.send)


def goal(joint: int, by: float) -> Any:
    out = START.copy()
    out[joint] += by
    return out


def test_it_ends_there_within_the_share_of_the_limits() -> None:
    arm, there = Arm(), goal(0, 0.05)
    arm.way().go(there, lambda: None)
    assert np.allclose(arm.position, there, atol=1e-6)
    speeds = np.array([target.velocity[:7] for target, _, _ in arm.sent])
    assert np.all(np.abs(speeds) <= SETTING.approach * ROBOT.safety.velocity + 1e-9)
    steps = np.diff([target.position[:7] for target, _, _ in arm.sent], axis=0) / PERIOD
    assert 0.0 < np.max(np.abs(steps) / ROBOT.safety.velocity) <= SETTING.approach + 1e-9


def test_it_does_not_make_up_for_lost_time() -> None:
    arm, heartbeats = Arm(stall=0.04), list[float]()
    arm.way().go(goal(0, 0.05), lambda: heartbeats.append(time.monotonic()))
    times = [at for _, _, at in arm.sent]
    assert len(times) > 6
    assert len(heartbeats) > len(times) and np.max(np.diff(heartbeats)) < 0.15, "the watchdog watches"
    assert np.min(np.diff(times)) > 0.6 * PERIOD


def test_the_hand_is_given_time_to_where_it_is() -> None:
    """Its controller may have been told to close on something; a jump from there would be refused."""
    arm = Arm()
    arm.position[7:] = (0.0401, -0.0002)  # as measured, a little beyond what can be commanded
    arm.way().go(START, lambda: None)
    times = [takes for _, takes, _ in arm.sent]
    hand = np.array([target.position[7:] for target, _, _ in arm.sent])
    low, high = ROBOT.hand_range
    assert times[0] == pytest.approx(1.0 / ROBOT.hand_speed, abs=0.02) and times[-1] == PERIOD
    assert hand[0] == pytest.approx([0.04, 0.0])
    assert np.all(low <= hand) and np.all(hand <= high)
    assert hand[-1] == pytest.approx(ROBOT.hand_open)


def test_a_hand_that_does_not_follow_is_noticed() -> None:
    there = START.copy()
    there[7:] = ROBOT.hand_closed
    with pytest.raises(MachineError, match=r"does not come to its start: panda_finger_joint1 is 0\.040"):
        Arm(hand=False).way().go(there, lambda: None)


def test_an_arm_that_does_not_follow_is_noticed() -> None:
    arm = Arm(lag=1.0)
    with pytest.raises(
        MachineError, match=r"does not follow the way to its start: panda_joint\d is 1\.00 rad"
    ):
        arm.way().go(goal(0, 0.3), lambda: None)
    moving = [target for target, _, _ in arm.sent if np.any(target.velocity)]
    assert len(moving) <= 1, "nothing more is sent"


def test_one_that_would_take_for_ever_is_refused() -> None:
    arm, slow = Arm(), dataclasses.replace(SETTING, approach=1e-3)
    with pytest.raises(MachineError, match=r"would take more than 60 s: panda_joint3 is 1\.00 away"):
        arm.way(setting=slow).go(goal(2, 1.0), lambda: None)
    assert not any(np.any(target.velocity) for target, _, _ in arm.sent)


def test_a_start_outside_of_the_workspace_is_refused_before_anything_moves() -> None:
    arm, box = Arm(), np.array([[0.9, -1.0, 0.0], [1.0, 1.0, 1.0]])
    with pytest.raises(InputError, match=r"tool at \(.*\), outside of safety.workspace"):
        arm.way(limits=dataclasses.replace(ROBOT.safety, workspace=box)).go(START, lambda: None)
    assert not arm.sent
