"""Starts the twin: the bridge and the node, as processes of their own, on this machine alone."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import select
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import IO, Any

from bt_tasksim.core import child
from bt_tasksim.core.closing import Closing
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.interrupts import ending
from bt_tasksim.hardware.ros.setting import load_setting
from bt_tasksim.hardware.ros.websocket import WebSocket
from bt_tasksim.hardware.twin.bridge_cleanup import note_bridge
from bt_tasksim.hardware.twin.environment import (
    bridge_binary,
    bridge_variables,
    environment,
    root,
    ros_variables,
)
from bt_tasksim.hardware.twin.evaluation import SECRET
from bt_tasksim.hardware.twin.gap import load_gap
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

START = 30.0
"""Longest time in seconds that a process may take to start."""
LOOPBACK = "127.0.0.1"
DOMAIN = 42


class Twin(Closing):
    """Bridge and node of a cell; `close` ends both.

    Attributes:
        port: Of rosbridge.
        evaluation_port: Of the evaluation channel.

    Args:
        robot: The robot.
        configuration: The world at first.
        port: Port of rosbridge; 0 for a free one.
        evaluation_port: Likewise, of the evaluation channel.
        domain: ROS domain.
        gap: File that says how the twin differs; by default the bundled one.
        ros: File with topics and names; by default the robot's bundled one.
        seed: Of factors and noise.
        log: Where the node's own words go; by default to this process's standard error.
        build: Make the twin's environment where it is missing.
        camera: Publish pictures, too; needs a renderer on this machine.

    Raises:
        InputError: A file is no good.
        MachineError: A process does not start.
    """

    def __init__(
        self,
        robot: RobotDescription,
        configuration: ActorConfiguration,
        *,
        port: int = 0,
        evaluation_port: int = 0,
        domain: int = DOMAIN,
        gap: str = "",
        ros: str = "",
        seed: int = 0,
        log: IO[Any] | None = None,
        build: bool = False,
        camera: bool = False,
    ) -> None:
        setting, rates = load_setting(robot, ros), load_gap(gap).rates
        if camera and not setting.cameras:
            raise InputError(f"'{setting.source}' names no cameras")
        setting.object_topics(actor.name for actor in configuration.objects)  # refused before anything starts
        self._python = environment(build)
        self.domain, self._log, self._heard = domain, log, setting.wrench.topic
        self.port = port or free_port()
        self.evaluation_port = evaluation_port or free_port()
        self.secret = secrets.token_hex(16)
        self._home = Path(tempfile.mkdtemp(prefix="bt-tasksim-twin-"))
        self.bridge: subprocess.Popen[Any] | None = None
        self.node: subprocess.Popen[Any] | None = None
        self.camera: subprocess.Popen[Any] | None = None
        world = self._home / "configuration.json"
        world.write_text(configuration.to_json())
        self._command = [
            str(self._python / "bin" / "python"),
            "-m",
            "bt_tasksim.hardware.twin.node",
            *("--robot", str(robot.source), "--urdf", str(robot.urdf)),
            *("--ros", str(setting.source), "--configuration", str(world)),
            *("--seed", str(seed), "--evaluation-port", str(self.evaluation_port)),
            *(("--gap", os.path.abspath(gap)) if gap else ()),
            *("--parent", str(os.getpid()), "--home", str(self._home)),
        ]
        try:
            self.start_bridge()
            self.start_node()
            if camera:
                self.start_camera(str(robot.source), str(setting.source), rates["camera_rate"])
        except BaseException:
            self.close()
            raise

    def start_bridge(self) -> None:
        """Start rosbridge, and wait until it listens, and hears the node where that runs.

        Raises:
            MachineError: It does not.
        """
        binary = bridge_binary(self._python)
        with contextlib.suppress(OSError), socket.create_connection((LOOPBACK, self.port), 1.0):
            raise MachineError(f"somebody listens at port {self.port} already; choose another one")
        self.bridge = subprocess.Popen(
            [str(binary), "--no-rosapi", "--bind", f"{LOOPBACK}:{self.port}"],
            env=bridge_variables(self._python, self.domain, self._home),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        note_bridge(self._home, self.bridge.pid, binary)
        end = time.monotonic() + START
        while time.monotonic() < end:
            if self.bridge.poll() is not None:
                raise MachineError(
                    f"rosbridge ended with status {self.bridge.returncode}; is port {self.port} free?"
                )
            with contextlib.suppress(OSError), socket.create_connection((LOOPBACK, self.port), 1.0):
                return self._meet()
            time.sleep(0.02)
        raise MachineError(f"rosbridge does not listen at port {self.port} after {START:g} s")

    def start_node(self) -> None:
        """Start the node, and wait until it is ready, and the bridge hears it.

        Raises:
            MachineError: It is not.
        """
        self.node = subprocess.Popen(
            self._command,
            env={**ros_variables(self.domain), SECRET: self.secret},
            stdout=subprocess.PIPE,
            stderr=self._log,
            start_new_session=True,
        )
        _wait_until_ready(self.node, "the twin")
        self._meet()

    def _meet(self) -> None:
        """Wait until what the node says comes out of the bridge: it takes them seconds to find each other."""
        if any(process is None or process.poll() is not None for process in (self.bridge, self.node)):
            return
        try:
            listener = WebSocket(LOOPBACK, self.port)
            try:
                topic = {"topic": self._heard, "type": "geometry_msgs/WrenchStamped"}
                listener.send(json.dumps({"op": "subscribe", **topic}))
                heard = listener.receive(START)
            finally:
                listener.close()
        except OSError as error:
            raise MachineError(f"rosbridge has gone: {error}") from None
        if heard is None:
            raise MachineError(f"rosbridge hears nothing of the twin after {START:g} s")

    def start_camera(self, robot: str, ros: str, rate: int) -> None:
        """Start the camera, and wait for its first picture.

        Raises:
            MachineError: There is none.
        """
        self.camera = subprocess.Popen(
            [
                *(sys.executable, "-m", "bt_tasksim.hardware.twin.camera", "--robot", robot, "--ros", ros),
                *("--port", str(self.port), "--evaluation-port", str(self.evaluation_port)),
                *("--rate", str(rate)),
            ],
            env={**os.environ, **child.VARIABLES, "PYTHONPATH": str(root()), SECRET: self.secret},
            stdout=subprocess.PIPE,
            stderr=self._log,
            start_new_session=True,
        )
        _wait_until_ready(self.camera, "the twin's camera")

    def ended(self) -> str:
        """Which process has ended, as a sentence; empty while both run."""
        for name, process in (
            ("rosbridge", self.bridge),
            ("the twin", self.node),
            ("the twin's camera", self.camera),
        ):
            if process is not None and process.poll() is not None:
                return f"{name} has ended with status {process.returncode}"
        return ""

    def wait(self) -> str:
        """Wait until a process ends, and say which."""
        while not (ended := self.ended()):
            time.sleep(0.2)
        return ended

    def close(self) -> None:
        """End every process."""
        with ending():
            for process in (self.camera, self.node, self.bridge):
                if process is not None:
                    _end(process)
            shutil.rmtree(self._home, ignore_errors=True)


def _end(process: subprocess.Popen[Any]) -> None:
    process.terminate()
    try:
        process.wait(3.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdout is not None:
        process.stdout.close()


def _wait_until_ready(process: subprocess.Popen[Any], name: str) -> None:
    assert process.stdout is not None
    if not select.select([process.stdout], [], [], START)[0]:
        raise MachineError(f"{name} is not ready after {START:g} s")
    if process.stdout.readline().split()[:1] != [b"ready"]:
        raise MachineError(f"{name} did not start; its reason stands above")


def free_port() -> int:
    """A port that nobody listens at."""
    with socket.create_server((LOOPBACK, 0)) as server:
        return int(server.getsockname()[1])
