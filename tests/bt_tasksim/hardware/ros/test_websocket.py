"""The small WebSocket client and the watchdog's channel, against a server by another hand."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import re
import socket as py_socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from bt_tasksim.hardware.ros.hold import RosHold
from bt_tasksim.hardware.ros.websocket import LARGEST, WebSocket

websockets = pytest.importorskip("websockets")


LIMITS = ([2.0, 2.0], [7.5, 2.0], [-3.0, -3.0], [3.0, 3.0])
"""Speed, acceleration, lower and upper limits of two joints."""


class Server:
    """Echoes texts, keeps what has come, and says what it is told to."""

    def __init__(self) -> None:
        self.heard: list[str] = []
        self.clients: list[Any] = []
        self._ready = threading.Event()
        threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True).start()
        assert self._ready.wait(5.0)

    async def _serve(self) -> None:
        self.loop, self.end = asyncio.get_running_loop(), asyncio.Event()
        async with websockets.serve(self._client, "127.0.0.1", 0, max_size=None) as server:
            self.port = server.sockets[0].getsockname()[1]
            self._ready.set()
            await self.end.wait()

    async def _client(self, client: Any) -> None:
        self.clients.append(client)
        async for text in client:
            self.heard.append(text)
            if text.startswith("echo"):
                await client.send(text)

    def say(self, text: str) -> None:
        asyncio.run_coroutine_threadsafe(self.clients[-1].send(text), self.loop).result(5.0)

    def ping(self) -> float:
        async def go() -> float:
            return float(await (await self.clients[-1].ping()))

        return asyncio.run_coroutine_threadsafe(go(), self.loop).result(5.0)

    def drop(self) -> None:
        asyncio.run_coroutine_threadsafe(self.clients[-1].close(), self.loop).result(5.0)

    def close(self) -> None:
        if not self.loop.is_closed():
            self.loop.call_soon_threadsafe(self.end.set)


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server()
    yield made
    made.close()


@pytest.mark.parametrize("n", [0, 10, 120, 126, 60_000, 70_000, 300_000])
def test_texts_of_every_size_come_back(server: Server, n: int) -> None:
    socket = WebSocket("127.0.0.1", server.port)
    socket.send("echo" + "é" * n)
    assert socket.receive(5.0) == "echo" + "é" * n
    assert socket.receive(0.02) is None
    socket.close()


def test_pings_are_answered_and_long_texts_skipped(server: Server) -> None:
    socket = WebSocket("127.0.0.1", server.port)
    socket.send("echo")
    assert socket.receive(5.0) == "echo"
    reading = threading.Thread(target=lambda: socket.receive(0.5))
    reading.start()
    assert server.ping() < 0.5
    reading.join()
    texts = ("x" * (LARGEST + 1), "y" * 3 * LARGEST, "a short one")
    saying = threading.Thread(target=lambda: [server.say(text) for text in texts])
    saying.start()
    assert socket.receive(5.0) == "a short one"
    saying.join()
    socket.close()


def test_a_server_that_goes_away_or_is_none(server: Server) -> None:
    socket = WebSocket("127.0.0.1", server.port)
    server.close()
    with pytest.raises(OSError):
        for _ in range(50):
            socket.receive(1.0)
    with pytest.raises(OSError):
        WebSocket("127.0.0.1", 1)


def test_the_watchdog_says_hold_and_where_the_arm_is(server: Server) -> None:
    hold = RosHold("127.0.0.1", server.port, "/states", "/arm", ["a", "b"], "/hold", *LIMITS)
    hold.open()
    deadline = time.monotonic() + 5.0
    while len(server.heard) < 3 and time.monotonic() < deadline:
        time.sleep(0.01)
    assert [json.loads(t)["op"] for t in server.heard] == ["advertise", "advertise", "subscribe"]
    for junk in ("nonsense", "{}", '{"msg": {"name": ["a"], "position": []}}', '{"msg": 3}'):
        server.say(junk)
    states = {"name": ["x", "b", "a"], "position": [9.0, 2.0, 1.0]}
    server.say(json.dumps({"op": "publish", "topic": "/states", "msg": states}))
    server.say(json.dumps({"op": "publish", "msg": {"name": ["a", "b"], "position": [None, 1.0]}}))
    time.sleep(0.04)
    hold.hold("the runner is gone")
    while len(server.heard) < 5 and time.monotonic() < deadline:
        time.sleep(0.01)
    word, command = (json.loads(t) for t in server.heard[3:5])
    assert word["topic"] == "/hold" and word["msg"]["data"] == "watchdog: the runner is gone"
    assert command["topic"] == "/arm" and command["msg"]["joint_names"] == ["a", "b"]
    assert command["msg"]["points"][0]["positions"] == [1.0, 2.0]
    hold.close()
    with pytest.raises(OSError):
        RosHold("127.0.0.1", 1, "/states", "/arm", ["a"], "", [2.0], [7.5], [-3.0], [3.0]).hold(
            "nobody there"
        )


ODD = {
    "digits": '{"msg": {"name": ["a"], "position": [1' + "0" * 400 + "]}}",
    "too many digits": '{"msg": {"name": ["a"], "position": [1' + "0" * 10_000 + "]}}",
    "digits of a speed": '{"msg": {"name": ["a"], "position": [1], "velocity": [1' + "0" * 400 + "]}}",
    "deep": "[" * 100_000,
    "deep in a message": '{"msg": {"name": ["a"], "position": [' + "[" * 50_000 + "]" * 50_000 + "]}}",
    "names that are lists": '{"msg": {"name": [["a"]], "position": [1]}}',
    "a word": '"msg"',
    "infinite": '{"msg": {"name": ["a"], "position": [Infinity]}}',
    "no text": "\x00\ufffd\ud7ff",
    "words as numbers": '{"msg": {"name": ["a"], "position": ["2.5"]}}',
}


@pytest.mark.parametrize("name", ODD)
def test_the_watchdog_outlives_any_message(server: Server, name: str) -> None:
    """Where the robot takes no word to hold, the arm is held by what is known of it, so that has to go on."""
    hold = RosHold("127.0.0.1", server.port, "/states", "/arm", ["a"], "", [2.0], [7.5], [-3.0], [3.0])
    hold.open()
    deadline = time.monotonic() + 5.0
    while len(server.heard) < 2 and time.monotonic() < deadline:
        time.sleep(0.01)
    server.say(ODD[name])
    time.sleep(0.05)
    server.say(json.dumps({"msg": {"name": ["a"], "position": [1.0]}}))
    time.sleep(0.04)
    hold.hold("the runner is gone")
    while len(server.heard) < 3 and time.monotonic() < deadline:
        time.sleep(0.01)
    assert json.loads(server.heard[2])["msg"]["points"][0]["positions"] == [1.0]
    hold.close()


@pytest.mark.parametrize("frame", [b"\xf1\x02hi", b"\x81\x82\x00\x00\x00\x00hi", b"\x81\x7f" + b"\xff" * 8])
def test_frames_that_no_server_sends_end_the_connection(frame: bytes) -> None:
    with py_socket.create_server(("127.0.0.1", 0)) as listening:

        def serve() -> None:
            peer = listening.accept()[0]
            key = re.search(rb"Sec-WebSocket-Key: (\S+)", peer.recv(4096))[1]
            accept = base64.b64encode(hashlib.sha1(key + b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11").digest())
            head = b"HTTP/1.1 101 Switching Protocols\r\nSec-WebSocket-Accept: " + accept + b"\r\n\r\n"
            peer.sendall(head + frame)
            time.sleep(2.0)
            peer.close()

        threading.Thread(target=serve, daemon=True).start()
        socket = WebSocket("127.0.0.1", listening.getsockname()[1])
        with pytest.raises(OSError, match="frame"):
            socket.receive(1.5)
        socket.close()


def test_the_watchdog_connects_again(server: Server) -> None:
    hold = RosHold("127.0.0.1", server.port, "/states", "/arm", ["a"], "/hold", [2.0], [7.5], [-3.0], [3.0])
    hold.open()
    deadline = time.monotonic() + 5.0
    while len(server.heard) < 3 and time.monotonic() < deadline:
        time.sleep(0.01)
    server.drop()
    while len(server.heard) < 6 and time.monotonic() < deadline:
        time.sleep(0.01)
    assert len(server.clients) == 2 and json.loads(server.heard[5])["op"] == "subscribe"
    hold.hold("at once")
    while len(server.heard) < 7 and time.monotonic() < deadline:
        time.sleep(0.01)
    assert json.loads(server.heard[6])["msg"]["data"] == "watchdog: at once"
    hold.close()


def test_the_channel_loads_nothing_heavy() -> None:
    heavy = "('numpy', 'yaml', 'cv2', 'roslibpy')"
    look = f"import sys, bt_tasksim.hardware.ros.hold; print([m for m in sys.modules if m in {heavy}])"
    assert subprocess.run([sys.executable, "-c", look], capture_output=True, text=True).stdout.strip() == "[]"
