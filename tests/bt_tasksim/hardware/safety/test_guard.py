"""The guard: nothing beyond a limit goes out, and after a stop nothing but a hold does."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.world import JointTarget
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.hardware.ros.messages import ending_at_rest
from bt_tasksim.hardware.safety.checks import FORCE, IMPLAUSIBLE, NOT_FINITE, TORQUE, twist
from bt_tasksim.hardware.safety.engine import JointReading
from bt_tasksim.hardware.safety.guard import ENDED, FROZEN, Guard
from bt_tasksim.hardware.safety.stop import SafetyStop
from bt_tasksim.hardware.twin.controller import Controller, Trajectory
from bt_tasksim.robot.description import load_robot

ROBOT = load_robot("panda")
KINEMATICS = PinocchioKinematics(ROBOT)
START = np.concatenate([ROBOT.rest, ROBOT.hand_open])
PERIOD = 0.05
N = len(ROBOT.arm_joints)


def guard_of(policies=None, **limits):
    changed = {**limits} if policies is None else {**limits, "policies": policies}
    guard = Guard(
        dataclasses.replace(ROBOT, safety=dataclasses.replace(ROBOT.safety, **changed)), KINEMATICS.forward
    )
    guard.begin(START, PERIOD)
    return guard


def target(position, velocity=None):
    position = np.asarray(position, float)
    return JointTarget(position, np.zeros_like(position) if velocity is None else velocity)


def offset(*values):
    out = START.copy()
    out[: len(values)] += values
    return out


def at(joint, value):
    out = START.copy()
    out[joint] = value
    return out


def box(y):
    return np.array([[-1.0, -1.0, 0.0], [1.0, y, 1.0]])


def stopped(guard, position, sentence):
    with pytest.raises(SafetyStop) as error:
        guard.command(target(position))
    assert sentence in str(error.value), str(error.value)
    return error.value


# ---- commands ---------------------------------------------------------------------------------------------


def test_what_keeps_the_limits_goes_out_as_it_came_and_expires():
    guard, before = guard_of(), START
    for k in range(40):
        asked = target(offset(0.1 * (1 - np.cos(0.1 * k)), 0.0, 0.0, 0.05 * np.sin(0.1 * k) ** 2))
        sent = guard.command(asked)
        assert np.array_equal(sent.position, asked.position) and sent.validity == 0.15
        np.testing.assert_allclose(sent.velocity, (sent.position - before) / PERIOD, atol=1e-9)
        before = sent.position
    assert not np.array_equal(before, START)


@pytest.mark.parametrize(
    ("limits", "position", "name", "sentence"),
    [
        ({}, offset(0.15), "joint_velocity_limit", "panda_joint1 would move at 3 rad/s, 0.825 rad/s over"),
        ({}, offset(0.0, 0.3), "joint_step_limit", "panda_joint2 would step by 0.3 rad, 0.0825 rad over"),
        ({}, offset(3.0), "joint_position_limit", "panda_joint1 would be at 3 rad, 0.1 rad beyond its limit"),
        ({}, at(8, 0.05), "joint_position_limit", "panda_finger_joint2 would be at 0.05"),
        ({}, at(3, np.nan), "not_finite", "positions commanded, panda_joint4 at nan"),
        ({}, START[:8], "wrong_joints", "(8,) positions commanded for 9 joints"),
        ({"policies": {}}, offset(0.08), "joint_acceleration_limit", "panda_joint1 would change speed by 32"),
        ({"tool_speed": 0.2}, offset(0.036), "tool_speed_limit", "the tool would move at 0.22"),
        ({"policies": {"joint_acceleration": "clip"}, "tool_acceleration": 2.0}, offset(0.03),
         "tool_acceleration_limit", "the tool would change speed by 3.6"),
        ({"workspace": box(0.005)}, offset(0.03), "outside_workspace", "mm outside the box in y"),
    ],
)  # fmt: skip
def test_a_command_beyond_a_limit_stops(limits, position, name, sentence):
    guard = guard_of(**limits)
    assert stopped(guard, position, sentence).reason.name == name
    with pytest.raises(SafetyStop) as again:
        guard.command(target(START))
    assert sentence in str(again.value)
    assert guard.stopped.reason.name == name, "the first reason is the one that counts"
    guard.begin(START, PERIOD)
    guard.command(target(START))


def test_the_tool_must_be_able_to_stop_inside_the_box():
    guard = guard_of(workspace=box(0.05))
    guard.command(target(offset(0.02)))
    guard.command(target(offset(0.075)))
    assert KINEMATICS.forward(offset(0.15))[1] < 0.05
    assert (
        stopped(guard, offset(0.15), "the tool could not stop before it is").reason.name
        == "outside_workspace"
    )


def test_a_joint_must_be_able_to_stop_before_its_limit():
    guard = guard_of({}, acceleration=np.full(7, 15.0), upper=ROBOT.safety.upper - np.array([2.8] + [0] * 6))
    guard.command(target(offset(0.03)))
    assert (
        stopped(guard, offset(0.09), "panda_joint1 could not stop before 0.1").reason.name
        == "joint_position_limit"
    )


def test_clipping_slows_down_and_never_stops():
    clip = dict.fromkeys(
        ("joint_velocity", "joint_acceleration", "joint_position", "tool_acceleration"), "clip"
    )
    guard = guard_of(clip)
    sent = [guard.command(target(offset(0.3))).position[0] for _ in range(40)]
    assert sent[0] < START[0] + 0.05 and sent[-1] == START[0] + 0.3


commands = st.lists(st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9), min_size=1, max_size=25)


def hostile(positions, scale):
    """Commands that start tame and get worse."""
    for k, position in enumerate(positions):
        yield START + scale * (1 + k) * np.array(position) * np.array([1] * 7 + [0.01] * 2)


@settings(max_examples=60, deadline=None)
@given(
    commands,
    st.sampled_from([1e-3, 1e-2, 0.1, 1.0]),
    st.booleans(),
    st.integers(-1, 24),
    st.floats(-1e3, 1e3),
)
def test_whatever_comes_in_what_goes_out_keeps_the_limits(positions, scale, clip, bad, velocity):
    policies = {"joint_acceleration": "clip", "tool_acceleration": "clip"}
    if clip:
        policies |= {"joint_position": "clip", "joint_velocity": "clip"}
    guard = guard_of(policies)
    limits = guard.limits
    sent, halted = [START, START], False
    for k, position in enumerate(hostile(positions, scale)):
        if k == bad:
            position = position * np.nan
        try:
            out = guard.command(target(position, np.full(9, velocity)))
            np.testing.assert_allclose(out.velocity, (out.position - sent[-1]) / PERIOD, atol=1e-6)
            sent.append(out.position)
        except SafetyStop:
            halted = True
            ramp = [guard.brake().position for _ in range(20)]
            with pytest.raises(SafetyStop):
                guard.command(target(START))
            sent += ramp
            break
    at = np.array(sent)
    speed = np.diff(at, axis=0) / PERIOD
    change = np.diff(speed[:, :N], axis=0) / PERIOD
    slack = 1 + 1e-5
    assert np.all(at[:, :N] <= limits.upper + 1e-6) and np.all(at[:, :N] >= limits.lower - 1e-6)
    assert np.all(np.abs(speed[:, :N]) <= limits.velocity * slack)
    assert np.all(np.abs(change) <= limits.acceleration * slack)
    assert np.all(np.abs(np.diff(at[:, :N], axis=0)) <= limits.step * slack)
    commanded = at[: len(at) - (len(ramp) if halted else 0)]
    tool = KINEMATICS.forward(commanded)
    twists = np.array([twist(a, b, PERIOD) for a, b in pairwise(tool)])
    assert np.all(np.linalg.norm(twists[:, :3], axis=1) <= limits.tool_speed * slack)
    assert np.all(np.linalg.norm(twists[:, 3:], axis=1) <= limits.tool_turn * slack)
    changes = np.diff(twists, axis=0) / PERIOD
    assert np.all(np.linalg.norm(changes[:, :3], axis=1) <= limits.tool_acceleration * slack)
    assert np.all((tool[:, :3] >= limits.workspace[0] - 1e-6) & (tool[:, :3] <= limits.workspace[1] + 1e-6))
    if halted:
        np.testing.assert_array_equal(guard.brake().velocity, 0.0)


def test_a_simulated_arm_brakes_and_then_stands():
    guard = guard_of()
    for k in range(1, 8):
        guard.command(target(offset(0.005 * k * k)))
    guard.stop(ENDED(why="over"))
    ramp = [guard.brake() for _ in range(10)]
    speeds = [float(np.abs(t.velocity).max()) for t in ramp]
    assert speeds[0] > 0.0 and speeds == sorted(speeds, reverse=True) and speeds[-1] == 0.0
    assert all(t.validity == guard.limits.validity for t in ramp)
    np.testing.assert_array_equal(guard.brake().position, ramp[-1].position)


def sent_to(controller, sent, now, period=PERIOD):
    """A command as an engine sends it to a controller of trajectories."""
    limits = ROBOT.safety
    points = ending_at_rest(
        sent.position[:N], sent.velocity[:N], period, limits.acceleration, limits.lower, limits.upper,
        sent.validity,
    )  # fmt: skip
    at, speeds, times = zip(*((p.position, p.velocity, p.time) for p in points), strict=True)
    controller.accept(Trajectory(ROBOT.arm_joints, at, speeds, times), now)
    return at[-1]


def a_controller():
    return Controller(ROBOT.arm_joints, ROBOT.arm_lower, ROBOT.arm_upper, ROBOT.arm_velocity, ROBOT.rest)


def test_where_an_arm_stands_if_no_command_follows_is_inside():
    guard, controller = guard_of({"joint_acceleration": "clip", "tool_acceleration": "clip"}), a_controller()
    guard.limits = dataclasses.replace(guard.limits, workspace=box(0.15))
    guard.begin(START, PERIOD)
    for k in range(1, 20):  # one joint is fast, and another one has far less acceleration
        try:
            sent = guard.command(target(offset(0.05 * k, 0.0, 0.0, 0.01 * k)))
        except SafetyStop as stop:
            assert "the tool could not stop before it is" in str(stop)
            break
        rest = sent_to(controller, sent, PERIOD * k)
        assert KINEMATICS.forward(np.concatenate([rest, sent.position[N:]]))[1] <= 0.15
    assert 4 < k < 19


def test_an_arm_that_nears_a_limit_slows_down_and_is_not_stopped():
    guard = guard_of({"joint_acceleration": "clip"}, tool_acceleration=1e3, tool_turn_acceleration=1e3)
    room = guard.upper[0] - START[0]
    guard.begin(START + np.array([room - 0.8] + [0] * 8), PERIOD)
    for k in range(1, 40):
        sent = guard.command(target(START + np.array([room - 0.8 + min(0.08 * k, 0.8)] + [0] * 8)))
    assert sent.position[0] == pytest.approx(guard.upper[0])


@pytest.mark.parametrize("gap", [0.03, 0.06, 0.1, 0.13])
def test_a_command_that_comes_late_does_not_jerk_the_arm(gap):
    guard, controller = guard_of({"joint_acceleration": "clip", "tool_acceleration": "clip"}), a_controller()
    period, now, position, seen = 0.02, 0.0, START.copy(), []
    guard.begin(START, period)
    for k in range(60):
        if k == 40:
            guard.late(gap - period)
        position[0] += min(1.5, 0.1 * k) * period
        sent_to(controller, guard.command(target(position.copy())), now, period)
        after = now + (gap if k == 39 else period)
        seen += [controller.setpoint(t)[1][0] for t in np.arange(now, after - 1e-9, 1e-3)]
        now = after
    assert min(seen) >= 0.0 and max(seen) <= guard.velocity[0]
    assert np.abs(np.diff(seen)).max() / 1e-3 <= 4.0 * guard.acceleration[0] * 1.01, "see docs/safety.md"
    assert controller.setpoint(now)[0][0] > START[0] + 1.0


@pytest.mark.parametrize("late", [0.0, 0.02])
def test_a_hand_measured_beside_its_range_is_commanded_inside(late):
    guard = guard_of({"joint_acceleration": "clip", "tool_acceleration": "clip"})
    guard.begin(START + np.concatenate([np.zeros(N), [2e-4, -2e-4]]), PERIOD)
    for k in range(1, 5):  # as hard as is clipped, so that part of each motion is left out
        sent = guard.command(target(offset(0.04 * k, 0.03 * k)))
        assert np.all(sent.position <= guard.upper) and np.all(sent.position >= guard.lower)
        if late:
            guard.late(late)
            assert np.all(guard.motion.position[N:] == sent.position[N:])


def test_a_robot_without_limits_is_not_driven():
    with pytest.raises(InputError, match="has no section 'safety'"):
        Guard(dataclasses.replace(ROBOT, safety=None), KINEMATICS.forward)


@pytest.mark.parametrize(
    ("times", "sentence"),
    [
        ({}, r"every 100 ms cannot expire after 150 ms: raise the control frequency, or raise validity of"),
        ({"validity": 0.2, "watchdog": 0.1}, r"every 100 ms suit no watchdog of 100 ms: .* raise watchdog"),
        (
            {"validity": 0.2, "stale": 0.15},
            r"notice states of 150 ms too late to hold in 250 ms: .* lower stale",
        ),
    ],
)
def test_a_period_must_suit_the_limits_times(times, sentence):
    guard = guard_of(**times)
    with pytest.raises(InputError, match=sentence):
        guard.begin(START, 0.1)
    with pytest.raises(InputError, match=sentence):
        guard.check_period(0.1)
    guard.check_period(0.05)


# ---- states -----------------------------------------------------------------------------------------------


def reading(position=START, stamp=10.0, names=ROBOT.joints, velocity=None):
    position = np.array(position, float)
    return JointReading(
        tuple(names), position, np.zeros_like(position) if velocity is None else velocity, stamp
    )


@pytest.mark.parametrize(
    ("state", "now", "name", "sentence"),
    [
        (reading(), 10.2, "stale_joint_states", "joint states are 200 ms old, the limit is 100 ms"),
        (reading(names=ROBOT.joints[::-1]), 10, "wrong_joints", "another order, 'panda_finger_joint2' where"),
        (reading(names=("x", *ROBOT.joints[1:])), 10, "wrong_joints", "joint states lack 'panda_joint1'"),
        (reading(names=(*ROBOT.joints, "x")), 10, "wrong_joints", "name 'x', which is no joint of the robot"),
        (reading(names=(*ROBOT.joints, "panda_joint1")), 10, "wrong_joints", "name a joint twice"),
        (reading(START[:4]), 10, "wrong_joints", "(4,) positions reported for 9 joints"),
        (reading(at(0, np.nan)), 10, "not_finite", "panda_joint1 at nan"),
        (reading(velocity=np.full(9, np.nan)), 10, "not_finite", "velocities reported, panda_joint1 at nan"),
        (reading(offset(0.0, 0.4)), 10, "tracking_error", "panda_joint2 is off its command by 0.4 rad"),
    ],
)  # fmt: skip
def test_states_that_are_not_to_be_trusted_stop(state, now, name, sentence):
    guard = guard_of()
    with pytest.raises(SafetyStop) as error:
        guard.reading(state, now)
    assert sentence in str(error.value) and error.value.reason.name == name
    with pytest.raises(SafetyStop):
        guard.command(target(START))


def test_a_jump_of_a_measured_joint_stops():
    guard = guard_of(tracking=10.0)
    guard.reading(reading(), 10.0)
    guard.reading(reading(offset(0.03), 10.01), 10.01)
    guard.reading(reading(offset(0.03), 10.01), 10.02)
    with pytest.raises(SafetyStop, match="panda_joint1") as error:
        guard.reading(reading(offset(0.43), 10.02), 10.03)
    assert error.value.outcome.is_a(IMPLAUSIBLE)


@pytest.mark.parametrize("tremor", [0.0, 1e-4])
def test_states_that_no_longer_change_stop_once_commands_do(tremor):
    def frozen(k):  # the hand's joints may tremble, and say nothing about the arm
        return START + tremor * (-1) ** k * np.array([0] * N + [1] * 2)

    guard = guard_of()
    for k in range(10):  # the arm stands, and so do the commands
        guard.reading(reading(frozen(k), 10 + 0.05 * k), 10 + 0.05 * k)
        guard.command(target(START))
    for k in range(10, 12):  # an arm takes some time to move
        guard.reading(reading(frozen(k), 10 + 0.05 * k), 10 + 0.05 * k)
        guard.command(target(offset(0.03 * (k - 9))))
    with pytest.raises(SafetyStop) as error:
        guard.reading(reading(frozen(12), 10.61), 10.61)
    assert error.value.outcome.is_a(FROZEN)
    assert error.value.outcome.numbers == pytest.approx({"time": 0.11, "way": 0.06})


def test_an_external_wrench_stops():
    guard = guard_of()
    guard.wrench(np.array([60.0, 0, 0, 0, 9.0, 0]))
    for wrench, reason, numbers in (
        ([0, 50.0, 50.0, 0, 0, 0], FORCE, {"value": 70.71, "excess": 5.71, "limit": 65.0}),
        ([0, 0, 0, 0, 0, -12.0], TORQUE, {"value": 12.0, "excess": 2.0, "limit": 10.0}),
        ([0, np.nan, 0, 0, 0, 0], NOT_FINITE, {}),
    ):
        with pytest.raises(SafetyStop) as error:
            guard.wrench(np.array(wrench, float))
        assert error.value.outcome.is_a(reason)
        assert error.value.outcome.numbers == pytest.approx(numbers, abs=0.01)
        guard.begin(START, PERIOD)
