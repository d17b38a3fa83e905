"""Served engines in real processes, and messages of every kind."""

from __future__ import annotations

import select
import signal
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bt_tasksim.core.world import WorldState
from bt_tasksim.engines.images import CameraModel, Image
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.engines.remote.handshake import identity
from bt_tasksim.engines.remote.messages import Message, encode
from bt_tasksim.engines.remote.schema import sizes_of
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene

ROOT = Path(__file__).resolve().parents[4]
START = 60.0
"""Seconds that a server may take to start on a machine that is busy with other things."""


@dataclass
class Served:
    """A server in a process of its own."""

    process: subprocess.Popen
    line: str
    log: Path

    @property
    def port(self) -> int:
        return int(self.line.rpartition(":")[2].split(" ")[0])

    @property
    def name(self) -> str:
        return f"remote:127.0.0.1:{self.port}"

    def said(self) -> list[str]:
        """Its lines on stderr, but for SAPIEN's about the Vulkan library."""
        return [line for line in self.log.read_text().splitlines() if "libvulkan" not in line]

    def signal(self, number: int) -> None:
        self.process.send_signal(number)


@contextmanager
def served(folder: Path, role: str, name: str, *words: Any, port: int = 0):
    """``bt-tasksim serve-engine`` until the end of the block."""
    log = folder / f"{role}-{np.random.default_rng().integers(1 << 40)}.log"
    command = [sys.executable, "-m", "bt_tasksim.cli", "serve-engine", role, name, "--port", str(port)]
    with open(log, "w") as stderr:
        process = subprocess.Popen(
            [*command, *map(str, words)], stdout=subprocess.PIPE, stderr=stderr, text=True, cwd=ROOT
        )
    try:
        ready = select.select([process.stdout], [], [], START)[0]
        line = process.stdout.readline().strip() if ready else ""
        assert line.startswith("serving "), log.read_text()
        yield Served(process, line, log)
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.kill()
        process.wait()
        process.stdout.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("servers")


@pytest.fixture(scope="module")
def robot():
    return load_robot("panda")


@pytest.fixture(scope="module")
def world():
    return Scene(fixtures=["shelf"], objects={"cup": "on upper_board", "box": "on table"}).sample(3)


@pytest.fixture(scope="module")
def sizes(robot, world):
    return sizes_of(robot, world)


@pytest.fixture(scope="module")
def state(robot, world):
    kinematics = PinocchioKinematics(robot)
    joints = np.concatenate([robot.rest, robot.hand_open])
    return WorldState(
        time=np.float64(0.25),
        joint_position=joints,
        joint_velocity=np.zeros_like(joints),
        joint_effort=np.zeros_like(joints),
        tip_force=np.zeros((len(robot.tips), 3)),
        wrench=np.zeros(6),
        tool_pose=kinematics.forward(joints),
        tips=kinematics.tips(joints),
        objects=np.array([actor.pose for actor in world.objects]),
        velocities=np.zeros((len(world.objects), 6)),
    )


@pytest.fixture(scope="module")
def image():
    rng = np.random.default_rng(0)
    camera = CameraModel("scene", 320, 240, np.diag([300.0, 300.0, 1.0]), np.array([0, 0, 1.0, 1, 0, 0, 0]))
    depth = rng.uniform(0.5, 2.0, (240, 320)).astype(np.float32)
    return Image(camera, rng.integers(0, 256, (240, 320, 3), dtype=np.uint8), depth)


def hello(robot, role: str, number: int = 1, /, **changes: Any) -> list[bytes]:
    """The frames of a ``hello``."""
    own = identity(role, robot)
    fields = {"role": own.role, "version": own.version, "robot": own.robot, "digests": dict(own.digests)}
    return encode(Message(number, "hello", {**fields, **changes}), {})
