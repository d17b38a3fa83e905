"""Real processes, real signals: whatever goes wrong, the arm holds in time and the reason is said."""

import time
from dataclasses import replace

import numpy as np
import pytest
from arm import SCENE, ArmProcess, runner_of
from faults import FAULTS, QUIET, measure

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.execution.runner import SAFETY_STOP
from bt_tasksim.hardware.safety.stop import SafetyStop
from bt_tasksim.robot.limits import REACTION

SAID = {
    "joint states stop": "INVALID: stale_joint_states: sweep: ",
    "joint states frozen": "INVALID: frozen_joint_states: sweep: ",
    "states delayed 300 ms": "INVALID: stale_joint_states: sweep: ",
    "NaN in a state": "INVALID: not_finite: sweep: ",
    "wrong joint order": "INVALID: wrong_joints: sweep: ",
    "positions of two joints mixed up": "INVALID: implausible_joint_states: sweep: ",
    "emergency stop": "INVALID: emergency_stop: ",
    "connection lost": "INVALID: robot_engine_failed: sweep: ",
    "leaf raises": "leaf 'sweep' raised ZeroDivisionError in faults.py:",
    "leaf blocks 2 s": "INVALID: watchdog_stop: sweep: ",
    "policy gives NaN": "leaf 'sweep' commands a tool target that is not finite",
    "no solution of the inverse kinematics": "FAILURE: out_of_reach: sweep: ",
    "watchdog killed": "INVALID: watchdog_stop: sweep: ",
    "SIGINT": "stopped KeyboardInterrupt every node has ended, and the arm holds []",
    "SIGTERM": "stopped Terminated every node has ended, and the arm holds []",
    "SIGKILL of the runner": "bt-tasksim watchdog: the runner is gone",
    "SIGSTOP of the runner": "bt-tasksim watchdog: no sign of life from the runner for",
}
OR = {"SIGSTOP of the runner": ("command_late", "checked_late")}
"""What may be said instead: the last command expires before the watchdog's time, and the runner, going on,
finds its next command late, or the check of a command, where it was stopped between that and its sending."""


@pytest.mark.parametrize("fault", FAULTS)
def test_the_arm_holds_in_time_and_the_reason_is_said(fault):
    for seed in range(3):
        seen = measure(fault, seed)
        if seen.busy <= QUIET:
            break  # else the arm's own process was kept waiting, and its times say nothing
    assert seen.held <= REACTION
    assert seen.far <= 0.2 and seen.drift <= 0.002, "it moves little farther, and stands then"
    assert seen.fastest <= 1.0, "and no faster than it went before"
    assert any(reason in seen.said for reason in (SAID[fault], *OR.get(fault, ()))), seen.said
    assert seen.running == [], "every node has ended"
    assert seen.again, "a fresh run works"


def test_a_robot_that_dies_ends_the_run():
    arm = ArmProcess()
    runner, leaf = runner_of(arm.port)
    leaf.trouble = lambda tool: (arm.process.kill() if leaf.context.now > 0.4 else None, tool)[1]
    try:
        result = runner.run(0)
        assert result.reason == "robot_engine_failed" and result.outcome.is_a(SAFETY_STOP)
        assert leaf.ended[-1].name == "INVALID"
        with pytest.raises(MachineError, match=r"cannot reach the robot: .*refused"):
            runner.run(0)
    finally:
        runner.close()
        arm.close()


@pytest.fixture
def arm():
    out = ArmProcess()
    yield out
    out.close()


def test_after_a_stop_nothing_starts_again_without_a_new_run(arm):
    runner, leaf = runner_of(arm.port)
    physics = runner.pipeline.physics
    leaf.trouble = lambda tool: (physics.engine.emergency.press("a test"), tool)[1]
    result = runner.run(0)
    assert result.reason == "emergency_stop"
    before = arm.stopped()
    with pytest.raises(SafetyStop, match="emergency stop: a test"):
        runner.step(runner.context.command)
    physics.engine.send(physics.guard.brake())  # even a command past the guard is refused by the robot
    end = time.monotonic() + 3.0
    while (after := arm.tell())["refused"] == before["refused"] and time.monotonic() < end:
        time.sleep(0.01)
    assert after["commands"] == before["commands"] and after["refused"] == before["refused"] + 1
    assert after["latched"].startswith("emergency stop")
    leaf.trouble, leaf.lasts = lambda tool: tool, 0.2
    physics.engine.emergency.held_down = lambda: True
    with pytest.raises(MachineError, match="the emergency stop is pressed; release it"):
        runner.run(0)
    physics.engine.emergency.held_down = lambda: False
    assert runner.run(0).success
    runner.close()


def test_an_emergency_stop_while_a_run_begins_counts(arm):
    runner, leaf = runner_of(arm.port)
    engine = runner.pipeline.physics.engine
    reset = engine.reset

    def pressed(configuration, heartbeat):
        reset(configuration, heartbeat)
        engine.emergency.press("too early")

    engine.reset = pressed
    with pytest.raises(SafetyStop, match="emergency stop: too early"):
        runner.run(0)
    assert arm.stopped()["commands"] == 0 and leaf.ended == []
    engine.reset, leaf.lasts = reset, 0.2
    assert runner.run(0).success
    runner.close()


def test_the_watchdog_watches_the_way_to_the_start_and_rests_then(arm):
    runner, leaf = runner_of(arm.port)
    engine = runner.pipeline.physics.engine
    reset = engine.reset

    def hangs(configuration, heartbeat):
        reset(configuration, heartbeat)
        heartbeat()
        time.sleep(0.4)
        heartbeat()

    engine.reset = hangs
    with pytest.raises(SafetyStop, match="the watchdog has stopped the robot: no sign of life"):
        runner.run(0)
    assert arm.stopped()["latched"].startswith("no sign of life") and leaf.ended == []
    engine.reset = lambda configuration, heartbeat: (reset(configuration, heartbeat), heartbeat())
    leaf.lasts, leaf.model.begin = 0.3, lambda seen: (time.sleep(0.4), seen.tool.copy())[1]
    assert runner.run(0).success, "a leaf may plan before its first command"
    runner.close()


def test_a_watchdog_that_had_to_stop_the_arm_is_replaced(arm):
    runner, leaf = runner_of(arm.port)
    physics = runner.pipeline.physics
    hold = physics.engine.hold

    def fails(why, here):
        raise MachineError("the connection to the arm is lost")

    physics.engine.hold = fails
    leaf.lasts = 0.3
    runner.run(0)
    assert arm.stopped()["latched"] == "the runner asked for it" and runner.pipeline.hold_delivered
    first, physics.engine.hold = physics.watchdog.pid, hold
    assert runner.run(0).success and physics.watchdog.pid != first
    runner.close()


def test_that_nobody_could_tell_the_arm_is_said(arm):
    runner, leaf = runner_of(arm.port)
    physics = runner.pipeline.physics
    hold = physics.engine.hold

    def dies(tool):
        physics.watchdog._process.kill()
        physics.watchdog._process.wait()
        return tool

    def fails(why, here):
        raise MachineError("the connection to the arm is lost")

    physics.engine.hold, leaf.trouble = fails, dies
    outcome = runner.run(0).outcome
    assert outcome.is_a(SAFETY_STOP) and outcome.names["arm"].startswith("nobody could tell the arm")
    physics.engine.hold = hold
    runner.close()


def test_nothing_moves_where_the_period_does_not_suit_the_limits(arm):
    runner, _ = runner_of(arm.port)
    with pytest.raises(InputError, match="every 100 ms cannot expire"):
        runner.reset(replace(SCENE.sample(0), control_frequency=10))
    assert arm.tell()["latched"] == "no run has begun"
    runner.close()


def test_a_command_that_was_held_up_after_its_checks_is_not_sent(arm):
    runner, leaf = runner_of(arm.port)
    physics = runner.pipeline.physics
    command = physics.guard.command
    physics.guard.command = lambda target: (time.sleep(0.07 * (leaf.context.now > 0.3)), command(target))[1]
    result = runner.run(0)
    assert result.reason == "checked_late"
    runner.close()


@pytest.mark.parametrize(("wrench", "here"), [(90.0, True), (np.nan, False)])
def test_an_arm_that_pushes_against_something_stops_where_it_is(arm, wrench, here):
    runner, _ = runner_of(arm.port)
    engine = runner.pipeline.physics.engine
    state = engine.state

    def pushed(reading):
        now = state(reading)
        return replace(now, wrench=np.full(6, wrench)) if now.time > 0.3 else now

    engine.state = pushed
    result = runner.run(0)
    assert result.reason == ("force_limit" if here else "not_finite")
    assert arm.stopped()["here"] is here
    runner.close()


def test_a_run_that_ends_well_holds_and_says_how_well_it_kept_time(arm):
    runner, leaf = runner_of(arm.port)
    leaf.lasts = 0.5
    result = runner.run(0)
    assert result.success and result.verdict is None
    told = arm.stopped()
    assert told["latched"] == "the run is over" and told["refused"] == 0
    assert result.timing.ticks == result.control_steps == told["commands"]
    assert result.timing.latency_median is not None and result.timing.latency_median < 0.1
    runner.close()


def test_a_tree_gets_the_joint_states_that_were_checked(arm):
    runner, leaf = runner_of(arm.port)
    physics = runner.pipeline.physics
    leaf.lasts, checked, given = 0.5, [], []
    look = physics.guard.reading

    def check(reading, now):
        look(reading, now)
        checked.append(reading.position[:7].tolist())
        physics.engine._reading = replace(reading, position=reading.position + 1e-3)  # the next one is here

    physics.guard.reading = check
    result = runner.run(0, record=lambda step: given.append(step.observation.arm_position.tolist()))
    assert result.success, result.why
    assert len(given) > 5 and all(position in checked for position in given)
    runner.close()
