"""The robot's engine with a link that only remembers: what it makes of messages, and what it sends."""

from __future__ import annotations

import dataclasses
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.resources import asset
from bt_tasksim.core.world import JointTarget
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.engines.remote.address import Address
from bt_tasksim.hardware.ros.engine import RosRobot
from bt_tasksim.hardware.ros.messages import UnusableMessageError
from bt_tasksim.hardware.ros.sensors import Newest
from bt_tasksim.hardware.ros.setting import load_setting
from bt_tasksim.hardware.safety.engine import RealEngine
from bt_tasksim.hardware.twin.controller import Controller, Trajectory
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene

ROBOT = load_robot("panda")
KINEMATICS = PinocchioKinematics(ROBOT)
START = np.concatenate([ROBOT.rest, ROBOT.hand_open])


class Link:
    """In the place of a connection."""

    def __init__(self) -> None:
        self.lost, self.sent = "", []

    def publish(self, topic: str, message: dict[str, Any], within: float = 0.0) -> None:
        self.sent.append((topic, message))

    def close(self) -> None:
        self.lost = "closed"


def engine(tmp_path: Path | None = None, **changes: Any) -> RosRobot:
    file = ""
    if changes:
        data = yaml.safe_load(asset("robots", "ros", "panda.yaml").read_text())
        file = str(tmp_path / "cell.yaml")
        Path(file).write_text(yaml.safe_dump({**data, **changes}))
    setting = load_setting(ROBOT, file)
    if "emergency_stop" not in changes:  # nobody in these tests speaks on its topic
        setting = dataclasses.replace(setting, emergency_every=math.inf)
    made = RosRobot(ROBOT, setting, Address("127.0.0.1", 1), KINEMATICS)
    made.link = Link()
    made.began = time.monotonic()
    return made


def states(names: Any, position: Any, stamp: float, **more: Any) -> dict[str, Any]:
    header = {"stamp": {"sec": int(stamp), "nanosec": int(stamp % 1 * 1e9)}, "frame_id": ""}
    return {"header": header, "name": list(names), "position": list(position), **more}


def feel(robot: RosRobot) -> None:
    """Everything has spoken just now."""
    now = time.monotonic()
    robot.joints.take(states(robot.setting.wire, START[np.argsort(robot.setting.order)], now), now)
    for topic in (robot.setting.wrench.topic, *robot.setting.tips.topics):
        robot.sensors.newest[topic] = Newest(np.arange(6.0), now)


def test_it_is_an_engine_of_a_real_robot() -> None:
    assert isinstance(engine(), RealEngine)


def test_joint_states_come_in_the_robots_order(tmp_path: Path) -> None:
    wire = [*reversed(ROBOT.joints), "lift"]
    robot = engine(tmp_path, joint_states={"topic": "/js", "joints": wire})
    robot.joints.take(states(wire, [*reversed(START.tolist()), 9.0], 5.0), 100.0)
    reading = robot.latest()
    assert reading.names == ROBOT.joints and np.array_equal(reading.position, START)
    assert not reading.velocity.any() and reading.stamp == pytest.approx(100.0)
    robot.joints.take(states(wire, [*reversed((START + 0.01).tolist()), 9.0], 5.1), 100.1)
    assert np.allclose(robot.latest().velocity, 0.1)  # none was said: from the way


def test_another_order_is_left_to_the_guard() -> None:
    robot = engine()
    wrong = [ROBOT.joints[1], ROBOT.joints[0], *ROBOT.joints[2:]]
    robot.joints.take(states(wrong, START, 5.0), 100.0)
    assert robot.latest().names == tuple(wrong)
    with pytest.raises(MachineError, match=f"another order: {wrong[0]}, {wrong[1]}"):
        robot._held = False
        robot._checked()


def test_nonsense_leaves_the_last_state() -> None:
    robot = engine()
    feel(robot)
    before = robot.latest()
    with pytest.raises(UnusableMessageError):
        robot.joints.take({"name": [1]}, 0.0)
    assert robot.latest() is before


def test_a_command_ends_at_rest_and_carries_its_run() -> None:
    robot = engine()
    robot._held, robot._run = False, "run"
    velocity = np.zeros(9)
    velocity[1] = 1.0
    robot.send(JointTarget(START, velocity, 0.15))
    (arm_topic, arm), (hand_topic, hand) = robot.link.sent
    assert (arm_topic, hand_topic) == (robot.setting.arm.command, robot.setting.hand.command)
    assert arm["header"]["frame_id"] == hand["header"]["frame_id"] == "run"
    first, last = arm["points"]
    assert first["positions"] == ROBOT.rest.tolist() and first["velocities"][1] == 1.0
    assert not any(last["velocities"]) and last["positions"][1] > first["positions"][1]
    assert first["time_from_start"]["nanosec"] == 50_000_000
    assert last["time_from_start"]["nanosec"] == round(1e9 * (0.05 + 1.0 / 7.5))  # as fast as it may brake
    assert hand["points"][0]["velocities"] == [] and len(hand["points"]) == 1


def test_a_young_run_is_announced_with_its_commands() -> None:
    robot = engine()
    robot._held, robot._run, robot._announced = False, "run", time.monotonic() + 0.1
    robot.send(JointTarget(START, np.zeros(9), 0.15))
    assert robot.link.sent[0] == (robot.setting.begin, {"data": "run"}) and len(robot.link.sent) == 3
    time.sleep(0.1)
    robot.send(JointTarget(START, np.zeros(9), 0.15))
    assert len(robot.link.sent) == 5


def test_after_a_hold_nothing_is_sent() -> None:
    robot = engine()
    robot._held = False
    feel(robot)
    robot.hold("why not", here=True)
    (topic, stop), (word_topic, word) = robot.link.sent
    assert topic == robot.setting.arm.command and word_topic == robot.setting.hold
    assert word == {"data": "why not"} and stop["points"][0]["positions"] == ROBOT.rest.tolist()
    with pytest.raises(MachineError, match="holds until a new run begins"):
        robot.send(JointTarget(START, np.zeros(9)))
    assert len(robot.link.sent) == 2
    robot.hold("again", here=False)
    assert len(robot.link.sent) == 3, "the last command ends at rest; nothing but the word is said"


def test_a_lost_connection_is_said_by_everything() -> None:
    robot = engine()
    feel(robot)
    robot._held = False
    reading, target = robot.latest(), JointTarget(START, np.zeros(9))
    robot.link.lost = "the connection is lost"
    for act in (
        robot.latest,
        lambda: robot.state(reading),
        lambda: robot.send(target),
        lambda: robot.hold("", here=False),
    ):
        with pytest.raises(MachineError, match="the connection is lost"):
            act()


def test_nothing_moves_to_its_start_while_something_pushes() -> None:
    robot = engine()
    robot._held = False
    feel(robot)
    assert robot._checked() is robot.joints.newest
    robot.sensors.newest[robot.setting.wrench.topic].value[:3] = (0.0, 0.0, 1000.0)
    with pytest.raises(MachineError, match=r"force on the tool 1e\+03 N"):
        robot._checked()


def test_an_emergency_stop_tapped_while_a_run_begins(monkeypatch: Any) -> None:
    robot = engine()

    def connected(configuration: Any) -> Any:
        robot.button.take({"data": True}, 0.0)
        robot.button.take({"data": False}, 0.0)
        return robot.link

    monkeypatch.setattr(robot, "_connected", connected)
    monkeypatch.setattr(robot, "_expect_messages", lambda: None)
    with pytest.raises(MachineError, match="the emergency stop was pressed: /emergency_stop"):
        robot.reset(Scene("panda", objects={"cup": "on table"}).sample(0), lambda: None)
    assert not robot.link.sent


def test_old_forces_and_unseen_objects_are_errors() -> None:
    robot = engine()
    feel(robot)
    state = robot.state(robot.latest())
    assert state.wrench.tolist() == [0, 1, 2, 3, 4, 5] and state.tip_force.tolist() == [[0, 1, 2]] * 2
    assert np.allclose(state.tool_pose, KINEMATICS.forward(START)) and state.objects.shape == (0, 7)
    robot.sensors.objects = ("cup",)
    with pytest.raises(MachineError, match="nothing has come on /objects/cup/pose"):
        robot.state(robot.latest())
    robot.sensors.objects = ()
    time.sleep(robot.limits.stale + 0.02)
    with pytest.raises(MachineError, match="stale: nothing usable on /wrist/wrench"):
        robot.state(robot.latest())


def test_contact_from_the_drives_effort(tmp_path: Path) -> None:
    robot = engine(tmp_path, tips={"effort": 5.0})
    feel(robot)
    now = time.monotonic()
    effort = [0.0] * 7 + [-8.0, 3.0]
    robot.joints.take(states(robot.setting.wire, START, now, effort=effort), now)
    assert robot.state(robot.latest()).tip_force.tolist() == [[0, 0, 8], [0, 0, 0]]


def test_the_emergency_stop_is_pressed_once_and_held_down() -> None:
    robot = engine()
    pressed: list[str] = []
    robot.emergency.listen(pressed.append)
    for data in (False, True, True):
        robot.button.take({"data": data}, 0.0)
    assert pressed == ["/emergency_stop"] and robot.emergency.held_down()
    robot.button.take({"data": False}, 0.0)
    assert not robot.emergency.held_down() and robot.emergency.why == "/emergency_stop"


def test_an_emergency_stop_that_is_mute_is_noticed(tmp_path: Path, caplog: Any) -> None:
    robot = engine(tmp_path, emergency_stop={"topic": "/stop", "every": 0.2})
    feel(robot)
    with pytest.raises(MachineError, match="nothing has come on /stop, which should speak every 200 ms"):
        robot.latest()
    assert robot._silent() == ["/stop"]
    robot.button.take({"data": False}, time.monotonic())
    assert robot.latest() and not robot._silent()
    robot.button.take({"data": False}, time.monotonic() - 0.5)
    with pytest.raises(MachineError, match="nothing for 500 ms on /stop"):
        robot.latest()
    robot.button.warn()
    assert not caplog.records
    other = engine()  # one that speaks on a change alone cannot be told from one that is mute
    feel(other)
    assert other.latest() and not other._silent()
    other.button.warn()
    assert "nothing has come on /emergency_stop so far" in caplog.text
    caplog.clear()
    other.button.take({"data": False}, time.monotonic())
    other.button.warn()
    assert not caplog.records


def test_a_hold_where_the_arm_is_brakes() -> None:
    robot = engine()
    robot._held = False
    now = time.monotonic()
    velocity = [0.75] + [0.0] * 8
    robot.joints.take(states(robot.setting.wire, START, now, velocity=velocity), now)
    robot.hold("enough", here=True)
    (point,) = robot.link.sent[0][1]["points"]
    assert point["positions"][0] == pytest.approx(START[0] + 0.75 * 0.1 / 2) and not any(point["velocities"])
    assert point["time_from_start"] == {"sec": 0, "nanosec": 100_000_000}
    arguments = robot.hold_channel().arguments
    assert arguments["acceleration"] == robot.limits.acceleration.tolist() and arguments["lower"][0] < 0.0


def test_an_arm_far_off_its_command_is_given_the_time_to_stop_where_it_is() -> None:
    robot = engine()
    robot._held = False
    feel(robot)
    robot.send(JointTarget(START + 0.33, np.zeros(9), 0.15))
    controller = Controller(
        ROBOT.arm_joints, ROBOT.arm_lower, ROBOT.arm_upper, ROBOT.arm_velocity, ROBOT.rest
    )
    controller.stand(START[:7] + 0.33)
    robot.hold("tracking", here=True)
    (point,) = robot.link.sent[2][1]["points"]
    after = point["time_from_start"]["nanosec"] / 1e9
    controller.accept(
        Trajectory(robot.setting.arm.joints, [point["positions"]], [point["velocities"]], [after]), 1.0
    )
    speeds = np.array([controller.setpoint(1.0 + 0.001 * k)[1] for k in range(400)])
    assert np.all(np.abs(speeds) <= robot.limits.velocity * 1.001)
    assert np.allclose(controller.setpoint(2.0)[0], START[:7])


def test_tracking_must_be_somewhere(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="use --perception camera"):
        engine(tmp_path, objects=None)
