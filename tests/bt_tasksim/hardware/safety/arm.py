"""The engine of the arm of these tests, a tree that keeps it moving, and what injects faults."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import sys
import threading
import time
import uuid
from pathlib import Path
from typing import Any

import numpy as np

from bt_tasksim import Runner, Scene
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.world import Command, WorldState
from bt_tasksim.engines.base import PostProcessEngine
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.engines.perception.features import ObservationBuilder
from bt_tasksim.execution.pipelines import robot_pipeline
from bt_tasksim.hardware.safety.engine import ChannelSpec, EmergencyStop, JointReading, RealEngine, RobotClock
from bt_tasksim.robot.description import load_robot
from bt_tasksim.trees import sequence

HERE = Path(__file__).parent
SCENE = Scene("panda", objects={"cup": "on table"})
ROBOT = load_robot("panda")


class ArmProcess:
    """The arm's process, and a line to it for faults and questions."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(HERE / "arm_process.py"), *ROBOT.joints], stdout=subprocess.PIPE, text=True
        )
        self.port = int(self.process.stdout.readline())
        self.line = socket.create_connection(("127.0.0.1", self.port))
        self.answers = self.line.makefile()

    def inject(self, fault: str) -> None:
        """Inject a fault, or only note the moment of one that happens elsewhere."""
        self.line.sendall(json.dumps({"fault": fault}).encode() + b"\n")

    def tell(self) -> dict[str, Any]:
        """What has happened."""
        self.line.sendall(b'{"tell": 1}\n')
        return json.loads(self.answers.readline())

    def stopped(self, patience: float = 3.0) -> dict[str, Any]:
        """What has happened once the arm refuses commands; what it was told may still be on its way."""
        end = time.monotonic() + patience
        while not (told := self.tell())["latched"] and time.monotonic() < end:
            time.sleep(0.01)
        return told

    def at_rest(self, patience: float = 3.0) -> dict[str, Any]:
        """What has happened once the arm has held and stands."""
        end = time.monotonic() + patience
        while time.monotonic() < end:
            told = self.tell()
            if told["fault"] and told["fault"]["still"]:
                return told
            time.sleep(0.02)
        raise AssertionError(f"the arm did not come to rest: {told}")

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()
        self.answers.close()
        self.line.close()


class ArmEngine(RealEngine):
    """A `RealEngine` for it."""

    def __init__(self, port: int) -> None:
        self.port, self.emergency = port, EmergencyStop()
        self.kinematics = PinocchioKinematics(ROBOT)
        self._socket: socket.socket | None = None
        self._reading: JointReading | None = None
        self._lost = ""
        self._run = ""

    def reset(self, configuration: Any, heartbeat: Any) -> None:
        self.close()
        self._lost, self._reading, self._run = "", None, uuid.uuid4().hex
        self._began = time.monotonic()
        try:
            self._socket = socket.create_connection(("127.0.0.1", self.port))
        except OSError as error:
            raise MachineError(f"cannot reach the robot: {error}") from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._write({"run": self._run, "start": [*ROBOT.rest.tolist(), *ROBOT.hand_open.tolist()]})
        self._write({"states": 1})
        threading.Thread(target=self._listen, args=(self._socket, RobotClock()), daemon=True).start()
        end = time.monotonic() + 5.0
        while self._reading is None and time.monotonic() < end:
            time.sleep(0.005)
        self.latest()

    def send(self, target: Any) -> None:
        self._write({"run": self._run, "to": target.position.tolist(), "valid": target.validity})

    def latest(self) -> JointReading:
        if self._lost or self._reading is None:
            raise MachineError(self._lost or "no joint states have come")
        return self._reading

    def state(self, reading: JointReading) -> WorldState:
        joints = np.array(reading.position)
        return WorldState(
            time=np.float64(time.monotonic() - self._began),
            joint_position=joints,
            joint_velocity=np.array(reading.velocity),
            joint_effort=np.zeros_like(joints),
            tip_force=np.zeros((len(ROBOT.tips), 3)),
            wrench=np.zeros(6),
            tool_pose=self.kinematics.forward(joints),
            tips=self.kinematics.tips(joints),
        )

    def hold(self, why: str, here: bool) -> None:
        self._write({"hold": why, "here": here})

    def hold_channel(self) -> ChannelSpec:
        arguments = {"host": "127.0.0.1", "port": self.port}
        return ChannelSpec("socket_hold:SocketHold", arguments)

    def close(self) -> None:
        if self._socket is not None:
            gone, self._socket = self._socket, None
            with contextlib.suppress(OSError):
                gone.shutdown(socket.SHUT_RDWR)
            gone.close()

    def _write(self, message: dict[str, Any]) -> None:
        try:
            if self._socket is None or self._lost:
                raise OSError(self._lost or "not connected")
            self._socket.sendall(json.dumps(message).encode() + b"\n")
        except OSError as error:
            raise MachineError(f"the connection to the arm is lost: {error}") from error

    def _listen(self, sock: socket.socket, clock: RobotClock) -> None:
        try:
            for line in sock.makefile():
                if sock is not self._socket:
                    return
                message = json.loads(line)
                if "estop" in message:
                    self.emergency.press(message["estop"])
                    continue
                self._reading = JointReading(
                    tuple(message["names"]),
                    np.array(message["q"], float),
                    np.array(message["v"], float),
                    clock.convert(message["stamp"], time.monotonic()),
                )
        except (OSError, ValueError):
            pass
        if sock is self._socket:
            self._lost = "the arm has closed the connection"


class GivenPoses(PostProcessEngine):
    """In the place of perception: objects are where somebody says."""

    def reset(self, configuration: Any, model: Any) -> None:
        self.builder = ObservationBuilder(ROBOT, configuration)

    def observe(self, state: WorldState, images: Any) -> Any:
        return self.builder.build(state, np.array([[0.5, 0.0, 0.05, 1.0, 0.0, 0.0, 0.0]]))


class SweepLeaf(ConceptNode):
    """The leaf of a sweep, which keeps how it ended and hands on what the sweep is told.

    Attributes:
        trouble: Called at every tick with the command that it would give; gives the one to use.
        lasts: Seconds.
    """

    trouble = property(
        lambda self: self.model.trouble, lambda self, call: setattr(self.model, "trouble", call)
    )
    lasts = property(lambda self: self.model.lasts, lambda self, lasts: setattr(self.model, "lasts", lasts))

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.trouble = lambda tool: tool
        self.ended: list[Any] = []

    def terminate(self, new_status: Any) -> None:
        self.ended.append(new_status)
        super().terminate(new_status)


class Sweep(ConceptModel):
    """Moves the tool to and fro, 5 cm to each side, and misbehaves when told."""

    default_timeout = 60.0
    lasts = 60.0
    leaf_base = SweepLeaf

    def begin(self, seen: Any) -> Any:
        return seen.tool.copy()

    def command(self, action: Any, seen: Any, memory: Any) -> Command:
        tool = memory.copy()
        tool[:, 1] += 0.05 * (1.0 - np.cos(4.0 * seen.elapsed))
        return Command(tool=self.trouble(tool))

    def done(self, seen: Any, memory: Any) -> Any:
        return seen.elapsed >= self.lasts


def runner_of(port: int) -> tuple[Runner, SweepLeaf]:
    """A runner of a sweep on the arm."""
    leaf = Sweep(name="sweep")
    pipeline = robot_pipeline(ROBOT, ArmEngine(port), GivenPoses())
    return Runner(sequence("root", leaf), SCENE, pipeline=pipeline), leaf


def main() -> None:
    """A run in a process of its own: a port, and a word when the arm moves."""
    from bt_tasksim.core.errors import BtTasksimError

    runner, _ = runner_of(int(sys.argv[1]))

    def moving(step: Any) -> None:
        if abs(float(step.observation.time) - 0.5) < 0.026:
            print("moving", runner.pipeline.physics.watchdog.pid, flush=True)

    try:
        result = runner.run(0, record=moving)
        print("result", result.status.name, result.reason, result.why, flush=True)
    except KeyboardInterrupt as stop:
        running = [n.name for n in runner.tree.iterate() if n.status.name == "RUNNING"]
        print("stopped", type(stop).__name__, str(stop), running, flush=True)
    except BtTasksimError as error:
        print("error", error, flush=True)
    finally:
        runner.close()


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
