"""What a moving arm does on a hold without a ramp, by the engine and by the watchdog's channel."""

from __future__ import annotations

import json

import numpy as np
import pytest

from bt_tasksim.core.poses import Array
from bt_tasksim.hardware.ros import messages
from bt_tasksim.hardware.ros.hold import EVERY, JointSample, _motion, _standing
from bt_tasksim.hardware.twin.controller import Controller, Trajectory
from bt_tasksim.robot.description import load_robot

ROBOT = load_robot("panda")
assert ROBOT.safety is not None
LIMITS = ROBOT.safety
N = len(ROBOT.arm_joints)


def stopping(velocity: Array, age: float) -> tuple[Array, Array]:
    """Set-points and speeds ``(k, n)`` every millisecond of an arm that is told to hold while it moves.

    Args:
        velocity: Of the arm ``(n,)``.
        age: Seconds since the joint states from which the hold follows.
    """
    arm = Controller(ROBOT.arm_joints, ROBOT.arm_lower, ROBOT.arm_upper, ROBOT.arm_velocity, ROBOT.rest)
    ends = ROBOT.rest + 0.3 * velocity
    still = np.zeros(N)
    arm.accept(
        Trajectory(
            ROBOT.arm_joints, [ends.tolist(), (ends + 0.1 * velocity).tolist()],
            [velocity.tolist(), still.tolist()], [0.3, 0.5],
        ), 0.0,
    )  # fmt: skip
    told = 0.28
    here, speed = arm.setpoint(told - age)
    point = messages.standing(here, speed, LIMITS.acceleration, LIMITS.lower, LIMITS.upper)
    assert point.velocity is not None
    arm.accept(
        Trajectory(ROBOT.arm_joints, [point.position.tolist()], [point.velocity.tolist()], [point.time]), told
    )
    found = [arm.setpoint(told + 0.001 * k) for k in range(600)]
    return np.array([p for p, _ in found]), np.array([v for _, v in found])


@pytest.mark.parametrize("speed", [0.2, 0.7])
@pytest.mark.parametrize("age", [0.0, 0.02])
def test_a_moving_arm_brakes_within_its_limits_and_does_not_go_back(speed: float, age: float) -> None:
    velocity = np.zeros(N)
    velocity[0], velocity[3] = speed, -speed
    positions, speeds = stopping(velocity, age)
    change = np.abs(np.diff(speeds, axis=0)).max(axis=0) / 0.001
    slack = 1.05 if age == 0.0 else 2.0  # its states are a little late
    assert np.all(change <= slack * LIMITS.acceleration)
    forward = positions[:, [0, 3]] * np.array([1.0, -1.0])
    assert np.all(np.diff(forward, axis=0) > -1e-4)
    assert np.allclose(speeds[-1], 0.0)


def test_where_it_can_stand_is_within_its_range() -> None:
    position, velocity = LIMITS.upper - 0.01, np.ones(N)
    point = messages.standing(position, velocity, LIMITS.acceleration, LIMITS.lower, LIMITS.upper)
    assert np.array_equal(point.position, LIMITS.upper)


def test_the_watchdog_finds_the_same_point() -> None:
    rng = np.random.default_rng(0)
    limits = list(zip(LIMITS.velocity, LIMITS.acceleration, LIMITS.lower, LIMITS.upper, strict=True))
    for _ in range(100):
        position = rng.uniform(LIMITS.lower, LIMITS.upper)
        velocity = rng.uniform(-1.0, 1.0, N) * rng.choice([0.0, 0.1, 2.0, 100.0])
        can = np.clip(velocity, -LIMITS.velocity, LIMITS.velocity)
        point = messages.standing(position, can, LIMITS.acceleration, LIMITS.lower, LIMITS.upper)
        found = _standing(JointSample(0.0, position.tolist(), velocity.tolist()), limits)
        after = found["time_from_start"]
        assert np.allclose(found["positions"], point.position) and not any(found["velocities"])
        assert after["sec"] + 1e-9 * after["nanosec"] == pytest.approx(point.time, abs=1e-8)


def test_the_watchdog_knows_the_speed_said_or_not() -> None:
    def said(**more: object) -> str:
        return json.dumps({"msg": {"name": ["x", "b", "a"], "position": [9.0, 2.0, 1.0], **more}})

    joints = ["a", "b"]
    assert _motion(said(velocity=[0.0, 0.2, 0.1]), joints, 5.0, None) == JointSample(
        5.0, [1.0, 2.0], [0.1, 0.2]
    )
    assert _motion(said(), joints, 5.0, None) == JointSample(5.0, [1.0, 2.0], [0.0, 0.0])
    before = JointSample(5.0 - EVERY / 1000, [0.98, 2.0], [0.0, 0.0])
    found = _motion(said(velocity=[]), joints, 5.0, before)
    assert found is not None and np.allclose(found.velocity, [1.0, 0.0])
    for unsaid in ([1.0], ["?"] * 3, [None] * 3, 3):
        assert _motion(said(velocity=unsaid), joints, 5.0, before) == found
    for wrong in ("3", "[]", '{"msg": []}', said(position=[9.0, None, 1.0]), said(velocity=[1e999] * 3)):
        assert _motion(wrong, joints, 5.0, before) is None
