"""The twin as a ROS 2 node: the topics of a robot's cell. Runs in the twin's own virtual environment.

``python -m bt_tasksim.hardware.twin.node --robot FILE --urdf FILE --ros FILE --configuration FILE`` prints a
line with ``ready PORT``, the port of the evaluation channel, and goes on until it is stopped. One thread runs
physics in real time and takes messages between two steps (`loop`); steps that are late are caught up with, up
to a tenth of a second.
"""

from __future__ import annotations

import argparse
import math
import os
import secrets
import signal
import sys
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from trajectory_msgs.msg import JointTrajectory

from bt_tasksim.core.errors import BtTasksimError, InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.real_time import RealTime
from bt_tasksim.hardware.ros.setting import RosSetting, load_setting
from bt_tasksim.hardware.twin import loop
from bt_tasksim.hardware.twin.bridge_cleanup import clear_up, parent_has_ended
from bt_tasksim.hardware.twin.button import ReleaseAnnouncer
from bt_tasksim.hardware.twin.cell import NEVER, Cell, Readings
from bt_tasksim.hardware.twin.controller import MOST_POINTS, RefusedTrajectoryError, Trajectory
from bt_tasksim.hardware.twin.evaluation import SECRET, EvaluationServer, hidden_to_json
from bt_tasksim.hardware.twin.gap import load_gap
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import ActorConfiguration

SENSOR_FAULTS = ("silent", "frozen", "delayed", "nan", "order")
DELAY = 0.3
"""Seconds, of the fault ``delayed``."""


class TwinNode(Node):  # type: ignore[misc]
    """Topics in front of a cell.

    Args:
        cell: The cell.
        setting: Names of topics, joints and frames.
        real_time: Its loop.
    """

    def __init__(self, cell: Cell, setting: RosSetting, real_time: RealTime) -> None:
        super().__init__("bt_tasksim_twin", start_parameter_services=False, enable_rosout=False)
        self.cell, self.setting, self._real_time = cell, setting, real_time
        self.fault = ""
        self._delayed: deque[tuple[float, JointState]] = deque()
        self._frozen: list[float] = []
        self._said: dict[str, float] = {}
        subscribe, publish = self._subscribe, self._publisher
        # Commands first: where one and the word to hold are both there, the command is taken first.
        for group, topic in (("arm", setting.arm.command), ("hand", setting.hand.command)):
            subscribe(JointTrajectory, topic, self._taking(group), 1)
        if setting.begin:
            subscribe(String, setting.begin, lambda m: self.cell.begin(m.data[:64]), 10)
        if setting.hold:
            subscribe(String, setting.hold, lambda m: self.cell.hold(m.data[:400]), 10)
        self._button = ReleaseAnnouncer(setting.emergency_every)
        subscribe(Bool, setting.emergency_stop, self._press, 10)
        self._stop = publish(Bool, setting.emergency_stop, 10)
        self._joints = publish(JointState, setting.joint_states, 10)
        self._wrench = publish(WrenchStamped, setting.wrench.topic, 10)
        self._tips = [publish(WrenchStamped, topic, 10) for topic in setting.tips.topics]
        self._objects: dict[str, Any] = {}
        here = {int(wire): own for own, wire in enumerate(setting.order)}
        self._wire = [here.get(k, -1) for k in range(len(setting.wire))]
        self._tick = 0
        self._stopped = cell.stopped
        self._worlds = 0

    # Nobody asks for events of topics (such as a subscriber that does not match), and the executor goes
    # through all that could come each time that it waits: with some tens of topics longer than physics takes.

    def _publisher(self, kind: type, topic: str, depth: int) -> Any:
        quiet = PublisherEventCallbacks(use_default_callbacks=False)
        return self.create_publisher(kind, topic, depth, event_callbacks=quiet)

    def _subscribe(self, kind: type, topic: str, take: Callable[[Any], None], depth: int) -> None:
        quiet = SubscriptionEventCallbacks(use_default_callbacks=False)
        self.create_subscription(kind, topic, take, depth, event_callbacks=quiet)

    # ---- commands ---------------------------------------------------------------------------------------

    def _taking(self, group: str) -> Callable[[JointTrajectory], None]:
        names = dict(
            zip(self.setting.arm.joints + self.setting.hand.joints, self.cell.robot.joints, strict=True)
        )

        def take(message: JointTrajectory) -> None:
            try:
                if len(message.points) > MOST_POINTS:
                    raise RefusedTrajectoryError(f"{len(message.points)} points, more than {MOST_POINTS}")
                self.cell.command(
                    group,
                    Trajectory(
                        joints=[names.get(name, name) for name in message.joint_names],
                        positions=[point.positions for point in message.points],
                        velocities=[point.velocities for point in message.points],
                        times=[_seconds(point.time_from_start) for point in message.points],
                        run=message.header.frame_id,
                    ),
                )
            except RefusedTrajectoryError as error:
                self.say(f"{group}: a trajectory is refused: {error}", group)

        return take

    def _press(self, message: Bool) -> None:
        pressed = bool(message.data)
        if not self._button.is_own(pressed, time.monotonic()):
            self.cell.press(pressed)

    # ---- running ----------------------------------------------------------------------------------------

    def step(self) -> None:
        """One period: physics, and what the sensors say."""
        self.cell.step()
        if self.cell.stopped != self._stopped:
            self._stopped = self.cell.stopped
            if self._stopped not in ("", NEVER):
                print(f"twin: the arm holds: {self._stopped}", file=sys.stderr, flush=True)
        self._tick += 1
        for reading in self.cell.readings():
            self._publish(reading)
        if self._button.speaks(self.cell.pressed, time.monotonic()):
            self._stop.publish(Bool(data=False))

    def _publish(self, reading: Readings) -> None:
        now = time.time()
        stamp = _time(now - (self.cell.time - reading.time))
        setting = self.setting
        self._publish_joints(reading, stamp, now)
        self._wrench.publish(_wrench(reading.wrench, setting.wrench.frame, stamp))
        for publisher, force in zip(self._tips, reading.tips, strict=True):
            felt = np.concatenate([force, np.zeros(3)])
            publisher.publish(_wrench(felt, setting.tips.frame, stamp))
        gap = self.cell.gap.rates
        if (
            setting.objects is not None
            and self._tick % max(gap["control_rate"] // gap["object_rate"], 1) == 0
        ):
            for actor, pose in zip(self.cell.configuration.objects, reading.objects, strict=True):
                topic = setting.object_topic(actor.name)
                if topic not in self._objects:
                    self._objects[topic] = self._publisher(PoseStamped, topic, 10)
                self._objects[topic].publish(_pose(pose, setting.objects.frame, stamp))

    def _on_the_wire(self, values: Array) -> list[float]:
        """Values of the robot's joints in the wire's order; other joints there stand at zero."""
        return [float(values[k]) if k >= 0 else 0.0 for k in self._wire]

    def _publish_joints(self, reading: Readings, stamp: Time, now: float) -> None:
        message = JointState()
        message.header.stamp = stamp
        names = list(self.setting.wire)
        position = self._on_the_wire(reading.position)
        if self.fault == "silent":
            return
        if self.fault == "frozen":
            self._frozen = self._frozen or position
            position = self._frozen
        elif self.fault == "nan":
            position[2] = math.nan
        elif self.fault == "order":
            names[0], names[1] = names[1], names[0]
        message.name, message.position = names, position
        message.velocity = self._on_the_wire(reading.velocity)
        message.effort = self._on_the_wire(reading.effort)
        if self.fault == "delayed":
            self._delayed.append((now + DELAY, message))
            while self._delayed and self._delayed[0][0] <= now:
                self._joints.publish(self._delayed.popleft()[1])
        else:
            self._joints.publish(message)

    # ---- the evaluation channel -------------------------------------------------------------------------

    def answer(self, question: dict[str, Any]) -> dict[str, Any]:
        """Answer a question of the evaluation channel; see `EvaluationClient`."""
        match question.get("do"):
            case "load":
                text, seed = question.get("configuration"), question.get("seed", 0)
                if not isinstance(text, str) or not isinstance(seed, int):
                    raise InputError("'load' needs a configuration as text, and a number as seed")
                configuration = ActorConfiguration.from_json(text)
                names = [actor.name for actor in configuration.objects]
                topics = self.setting.object_topics(names)  # a name that makes none is refused first
                self.cell.load(configuration, seed)
                for topic in self._objects.keys() - set(topics):
                    self.destroy_publisher(self._objects.pop(topic))
                self.fault, self._frozen = "", []
                self._delayed.clear()
                self._worlds += 1
                self._real_time.set_aside()
                return {"done": True}
            case "picture":
                return self._picture(question.get("known"))
            case "truth":
                return hidden_to_json(self.cell.hidden()) | {"deepest_pair": self.cell.deepest_pair}
            case "tell":
                return {**self.cell.tell(), "object_topics": sorted(self._objects)}
            case "fault":
                self.fault = str(question.get("name", ""))
                self.cell.watch(self.fault)
                return {"done": True}
            case other:
                raise InputError(f"unknown question '{other}'; known: load, truth, tell, fault, picture")

    def _picture(self, known: Any) -> dict[str, Any]:
        """What a camera needs: where everything is, and the world where it is not the one that is known."""
        state = self.cell.state
        text = None if known == self._worlds else self.cell.configuration.to_json()
        return {
            "world": self._worlds,
            "configuration": text,
            "stamp": time.time(),
            "time": self.cell.time,
            "joint_position": state.joint_position.tolist(),
            "tool_pose": state.tool_pose.tolist(),
            "objects": [] if state.objects is None else state.objects.tolist(),
        }

    def leave_out(self, seconds: float) -> None:
        """Physics lags by so many seconds, and does not catch up."""
        self.cell.left_out += seconds
        self.say(f"{1000 * seconds:.0f} ms behind real time, which are left out", "late")

    def say(self, sentence: str, about: str) -> None:
        """A line on the standard error, once a second about each thing at most."""
        now = time.monotonic()
        if now - self._said.get(about, -1.0) >= 1.0:
            self._said[about] = now
            print(f"twin: {sentence}", file=sys.stderr, flush=True)


def run(node: TwinNode, server: EvaluationServer, parent: int) -> None:
    """Run until ROS is shut down, or the process that started this one is gone."""
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def going() -> bool:
        server.answer(node.answer)
        return bool(rclpy.ok()) and not parent_has_ended(parent)

    loop.run(node.cell.period, going, executor.spin_once, node.step, node.leave_out)


def _seconds(duration: Any) -> float:
    return float(duration.sec) + 1e-9 * float(duration.nanosec)


def _time(seconds: float) -> Time:
    whole = math.floor(seconds)
    return Time(sec=whole, nanosec=min(int((seconds - whole) * 1e9), 999_999_999))


def _wrench(values: Array, frame: str, stamp: Time) -> WrenchStamped:
    message = WrenchStamped()
    message.header.stamp, message.header.frame_id = stamp, frame
    force, torque = message.wrench.force, message.wrench.torque
    force.x, force.y, force.z, torque.x, torque.y, torque.z = values.tolist()
    return message


def _pose(values: Array, frame: str, stamp: Time) -> PoseStamped:
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = stamp, frame
    p, q = message.pose.position, message.pose.orientation
    p.x, p.y, p.z, q.w, q.x, q.y, q.z = values.tolist()
    return message


def main() -> int:
    """Run the twin; returns the exit status."""
    parser = argparse.ArgumentParser(description="The twin of a robot's cell, as a ROS 2 node.")
    parser.add_argument("--robot", required=True, metavar="FILE")
    parser.add_argument("--urdf", type=Path, metavar="FILE", help="of the robot, whose package is not here")
    parser.add_argument("--ros", required=True, metavar="FILE")
    parser.add_argument("--configuration", required=True, type=Path, metavar="FILE")
    parser.add_argument("--gap", default="", metavar="FILE")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--evaluation-port", type=int, default=0)
    parser.add_argument("--parent", type=int, default=0, metavar="PID", help="without it, the twin ends")
    parser.add_argument("--home", default="", metavar="DIR", help="to be cleared up then")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        robot = load_robot(options.robot, options.urdf)
        setting = load_setting(robot, options.ros)
        configuration = ActorConfiguration.from_json(options.configuration.read_text())
        gap = load_gap(options.gap)
        announced, sensor = bool(setting.begin), setting.wrench.pose
        cell = Cell(robot, gap, configuration, options.seed, announced=announced, sensor=sensor)
        server = EvaluationServer(
            options.evaluation_port, os.environ.pop(SECRET, "") or secrets.token_hex(16)
        )
    except (BtTasksimError, OSError) as error:
        print(f"twin: {error}", file=sys.stderr)
        return 2
    rclpy.init()
    real_time = RealTime()
    node = TwinNode(cell, setting, real_time)
    real_time.set_aside()
    print(f"ready {server.port}", flush=True)
    try:
        run(node, server, options.parent)
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except BtTasksimError as error:
        print(f"twin: {error}", file=sys.stderr)
        return 1
    finally:
        server.close()
        real_time.close()
        node.destroy_node()
        rclpy.try_shutdown()
        if options.home and parent_has_ended(options.parent):
            clear_up(Path(options.home))
    return 0


if __name__ == "__main__":
    sys.exit(main())
