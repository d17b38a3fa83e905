"""The twin on the command line: what it says when it cannot start, and that it leaves nothing behind."""

from __future__ import annotations

import dataclasses
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.hardware.twin import environment as place
from bt_tasksim.hardware.twin.launch import Twin, free_port
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene

ROOT = Path(__file__).parents[4]
WORLD = Scene("panda", objects={"cup": "on table"}).sample(0)


def words(*more: str) -> list[str]:
    return [sys.executable, "-m", "bt_tasksim.cli", "twin", *more]


def listens(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port), 1.0).close()
    except OSError:
        return False
    return True


def within(seconds: float, happens: Callable[[], bool]) -> bool:
    end = time.monotonic() + seconds
    while not (done := happens()) and time.monotonic() < end:
        time.sleep(0.1)
    return done


@pytest.fixture
def made() -> None:
    try:
        place.environment()
    except MachineError as error:
        pytest.skip(str(error))


def test_without_its_environment(monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(place, "root", lambda: tmp_path)
    with pytest.raises(MachineError, match="make twin-environment"):
        place.environment()
    with pytest.raises(MachineError, match=r"made by 'tools/make_twin\.py' of a checkout"):
        place.environment(build=True)


@pytest.mark.parametrize(
    ("more", "code", "sentence"),
    [
        (("nothing_there",), 2, "nothing_there"),
        (("--robot", "so100"), 2, "no file says how 'so100' speaks ROS"),
        (("--gap", "nowhere.yaml"), 2, "the twin's file 'nowhere.yaml'"),
        (("--domain", "500"), 2, "at most 101"),
        (("--robot", "xarm7_ability", "--camera"), 2, "names no cameras"),
    ],
)
def test_what_is_wrong_is_said(made, more: tuple[str, ...], code: int, sentence: str) -> None:
    port = str(free_port())
    ran = subprocess.run(words(*more, "--port", port), capture_output=True, text=True, cwd=ROOT, timeout=60)
    assert ran.returncode == code and sentence in ran.stderr and "Traceback" not in ran.stderr, ran.stderr


def test_a_port_that_is_taken(made) -> None:
    robot, domain = load_robot("panda"), 1 + os.getpid() % 100
    with (
        socket.create_server(("127.0.0.1", 0)) as taken,
        pytest.raises(MachineError, match="somebody listens at port"),
    ):
        Twin(robot, WORLD, port=taken.getsockname()[1], domain=domain)


def test_an_object_whose_name_makes_no_topic_is_refused_before_anything_starts() -> None:
    named = dataclasses.replace(
        WORLD, objects=tuple(dataclasses.replace(o, name="my-cup") for o in WORLD.objects)
    )
    with pytest.raises(InputError, match="the topic of object 'my-cup' should be"):
        Twin(load_robot("panda"), named)


def test_a_robot_without_its_topics(made, tmp_path) -> None:
    with pytest.raises(InputError, match=r"no file 'x\.yaml'"):
        Twin(load_robot("panda"), WORLD, ros="x.yaml")


def attentive() -> None:
    """No signal is ignored, whoever started the tests, be it a job in the background or with nohup."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_it_ends_with_everything_it_started(made, tmp_path: Path, stop: signal.Signals) -> None:
    port = free_port()
    domain = str(1 + os.getpid() % 100)
    process = subprocess.Popen(
        words("--port", str(port), "--domain", domain),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT,
        env={**os.environ, "TMPDIR": str(tmp_path)},
        preexec_fn=attentive,
    )  # fmt: skip
    assert process.stdout is not None
    lines = [process.stdout.readline() for _ in range(3)]
    assert "in real time" in lines[0] and f"ros:127.0.0.1:{port}" in lines[1]
    process.send_signal(stop)
    _, err = process.communicate(timeout=15)
    assert process.returncode == (-stop if stop == signal.SIGKILL else 0)
    assert not [line for line in err.splitlines() if "behind real time" not in line], err
    evaluation = int(re.search(r"port (\d+)", lines[2])[1])
    assert within(5.0, lambda: not listens(port) and not listens(evaluation))
    assert within(5.0, lambda: not list(tmp_path.iterdir()))
