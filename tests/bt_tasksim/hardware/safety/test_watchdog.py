"""The watchdog's process: when it holds, what it says, and that the runner notices its end."""

import os
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bt_tasksim.core.errors import MachineError
from bt_tasksim.hardware.safety.engine import ChannelSpec
from bt_tasksim.hardware.safety.watchdog import Watchdog
from bt_tasksim.hardware.safety.watchdog_process import DONE, HEARTBEAT, HOLD, RECORD, Watch

PATH = os.pathsep.join((str(Path(__file__).parents[4]), str(Path(__file__).parent)))
DEADLINE = 0.15


class Line:
    """The other end of the watchdog's own way to the robot."""

    def __init__(self):
        self.server = socket.create_server(("127.0.0.1", 0))
        self.peer = None

    @property
    def channel(self):
        arguments = {"host": "127.0.0.1", "port": self.server.getsockname()[1]}
        return ChannelSpec("socket_hold:SocketHold", arguments)

    def heard(self, patience=3.0):
        """What has come, and when."""
        if self.peer is None:
            self.peer = self.server.accept()[0]
        self.peer.settimeout(patience)
        try:
            return self.peer.recv(1000).decode(), time.monotonic()
        except TimeoutError:
            return "", time.monotonic()

    def close(self):
        for sock in (self.server, self.peer):
            if sock is not None:
                sock.close()


@pytest.fixture
def line():
    out = Line()
    yield out
    out.close()


@pytest.fixture
def watchdog(line):
    out = Watchdog(line.channel, DEADLINE)
    yield out
    out.close()


def beating(watchdog, seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        watchdog.heartbeat()
        time.sleep(0.02)
    return time.monotonic()


def test_it_holds_when_beats_stop_and_says_so(capfd, line):
    watchdog = Watchdog(line.channel, DEADLINE)
    last = beating(watchdog, 0.5)
    assert watchdog.trouble() == ""
    said, when = line.heard()
    assert said.startswith('{"hold": "no sign of life from the runner for 1')
    assert DEADLINE - 0.03 <= when - last <= DEADLINE + 0.1
    time.sleep(0.05)
    assert "the watchdog has stopped the robot: no sign of life" in watchdog.trouble()
    watchdog.close()
    assert "bt-tasksim watchdog: no sign of life" in capfd.readouterr().err


def test_it_does_not_hold_before_the_first_beat_nor_after_the_last_one(watchdog, line):
    assert line.heard(0.4)[0] == ""
    beating(watchdog, 0.1)
    watchdog.rest()
    assert line.heard(0.4)[0] == "" and watchdog.trouble() == ""


def test_it_holds_when_it_is_told_to(watchdog, line):
    watchdog.hold()
    assert "the runner asked for it" in line.heard()[0]


def test_ctrl_c_does_not_reach_it(watchdog, line):
    os.kill(watchdog.pid, signal.SIGINT)
    assert os.getpgid(watchdog.pid) != os.getpgid(0), "it has a session of its own"
    beating(watchdog, 0.1)
    assert watchdog.trouble() == "" and "no sign of life" in line.heard()[0]


def test_the_runner_notices_that_it_was_killed(watchdog):
    beating(watchdog, 0.1)
    os.kill(watchdog.pid, signal.SIGKILL)
    time.sleep(0.1)
    watchdog.heartbeat()
    assert watchdog.trouble() == "the watchdog's process has ended"


def test_the_runner_notices_that_it_hangs(watchdog):
    beating(watchdog, 0.3)
    assert watchdog.trouble() == ""
    os.kill(watchdog.pid, signal.SIGSTOP)
    try:
        beating(watchdog, DEADLINE + 0.05)
        assert re.match(r"the watchdog does not answer for (1|2)\d\d ms", watchdog.trouble())
    finally:
        os.kill(watchdog.pid, signal.SIGCONT)


def test_one_that_was_told_to_hold_serves_no_other_run(watchdog, line):
    beating(watchdog, 0.1)
    watchdog.hold()
    assert watchdog.trouble() == "the watchdog was told to stop the robot"


def test_it_holds_at_once_when_the_runner_is_gone(line):
    words = f"""
import sys, time
from bt_tasksim.hardware.safety.engine import ChannelSpec
from bt_tasksim.hardware.safety.watchdog import Watchdog
watchdog = Watchdog(ChannelSpec({line.channel.factory!r}, {line.channel.arguments!r}), 5.0)
watchdog.heartbeat()
print("beating", flush=True)
time.sleep(60)
"""
    process = subprocess.Popen(
        [sys.executable, "-c", words], stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": PATH}
    )
    assert process.stdout.readline() == b"beating\n"
    process.kill()
    killed = time.monotonic()
    said, when = line.heard()
    assert said == '{"hold": "the runner is gone"}\n' and when - killed < 0.2
    process.communicate()


@pytest.mark.parametrize(
    ("channel", "sentence"),
    [
        (
            ChannelSpec("socket_hold:SocketHold", {"host": "127.0.0.1", "port": 1}),
            "refused",
        ),
        (ChannelSpec("socket_hold:Gone"), "AttributeError"),
        (ChannelSpec("nowhere.at:All"), "No module named 'nowhere'"),
    ],
)
def test_what_cannot_reach_the_robot_does_not_start(channel, sentence):
    with pytest.raises(
        MachineError, match=r"the watchdog cannot reach the robot: .*; nothing was moved"
    ) as e:
        Watchdog(channel, DEADLINE)
    assert sentence in str(e.value)


def test_it_loads_nothing_that_could_hang_with_the_runner():
    safety = "bt_tasksim.hardware.safety"
    words = f"import sys, {safety}.watchdog_process, socket_hold; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", words], capture_output=True, text=True, check=True,
        env={**os.environ, "PYTHONPATH": PATH},
    )  # fmt: skip
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert not loaded & {"numpy", "py_trees", "pinocchio", "yaml", "sapien"}


def test_it_finds_no_modules_in_the_current_folder(tmp_path, monkeypatch, line):
    for name in ("json", "select", "bt_tasksim"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('not mine')\n")
    monkeypatch.chdir(tmp_path)
    watchdog = Watchdog(line.channel, DEADLINE)
    watchdog.hold()
    assert "the runner asked for it" in line.heard()[0]
    watchdog.close()


def test_records_may_arrive_in_pieces():
    watch = Watch(0.1)
    data = RECORD.pack(HEARTBEAT, 5.0) + RECORD.pack(HEARTBEAT, 6.0)
    assert not watch.feed(data[:4]) and watch.left(6.0) is None
    assert not watch.feed(data[4:11]) and watch.left(5.0) == pytest.approx(0.1)
    assert not watch.feed(data[11:]) and watch.left(6.05) == pytest.approx(0.05)
    assert not watch.feed(RECORD.pack(DONE, 7.0)) and watch.left(9.0) is None
    assert watch.feed(RECORD.pack(HEARTBEAT, 8.0) + RECORD.pack(HOLD, 8.0)) and watch.left(9.0) is None
    assert struct.calcsize("<cd") == RECORD.size


@pytest.mark.parametrize("record", [(b"X", 1.0), (HEARTBEAT, float("nan")), (HEARTBEAT, float("inf"))])
def test_a_record_that_is_none_asks_for_a_hold(record):
    watch = Watch(DEADLINE)
    assert not watch.feed(RECORD.pack(HEARTBEAT, 1.0))
    assert watch.feed(RECORD.pack(*record))
    assert watch.watching and watch.left(1.0) == pytest.approx(DEADLINE)
