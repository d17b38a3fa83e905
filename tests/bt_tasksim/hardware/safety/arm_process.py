"""An arm in a process of its own, for tests: first-order joints, a small protocol over TCP, faults on demand.

Lines of JSON. To the arm: ``run`` with ``start`` begins a run and ends a hold; ``run`` with ``to`` and
``valid`` is a command, given up after so many seconds; ``hold`` ends the run: the joints stop, and commands
are refused from then on. ``states`` asks for joint states at 100 Hz; ``fault`` injects one; ``tell``
asks what has happened since. It imports the standard library alone.
"""

from __future__ import annotations

import json
import math
import select
import socket
import sys
import time
from collections import deque

STEP = 0.004
STATES = 0.01
LAG = 0.03
"""Time constant of a joint, seconds."""
FASTEST = 3.0
"""rad/s."""
STILL = 0.02
"""rad/s below which the arm stands."""


class Arm:
    """Joints that go to where they are told, and what is noted of them."""

    def __init__(self, names: list[str]) -> None:
        self.names = names
        self.q = [0.0] * len(names)
        self.v = [0.0] * len(names)
        self.target = list(self.q)
        self.run, self.latched, self.expires = "", "no run has begun", 0.0
        self.moving_to = False
        self.fault: dict | None = None
        self.commands = self.refused = 0
        self.here: bool | None = None
        self.busy = 0.0

    def take(self, message: dict, now: float) -> None:
        if "start" in message:
            self.run, self.latched, self.moving_to = message["run"], "", False
            self.q, self.target, self.v = list(message["start"]), list(message["start"]), [0.0] * len(self.q)
            self.fault, self.commands, self.refused = None, 0, 0
        elif "to" in message:
            if self.latched or message["run"] != self.run:
                self.refused += 1
                return
            self.commands += 1
            self.target, self.expires, self.moving_to = message["to"], now + message["valid"], True
        elif "hold" in message and not self.latched:
            self.latched, self.here = message["hold"], message.get("here")
            self.target = list(self.q)
            self.stopped(now, message["hold"])

    def stopped(self, now: float, why: str) -> None:
        self.moving_to = False
        if self.fault is not None and self.fault["held"] is None:
            self.fault["held"], self.fault["why"] = now, why

    def inject(self, name: str, now: float) -> None:
        self.fault = {
            "name": name, "at": now, "q": list(self.q), "held": None, "why": "", "still": None,
            "far": 0.0, "fastest": 0.0,
        }  # fmt: skip

    def advance(self, now: float, dt: float) -> None:
        if self.moving_to and now > self.expires:
            self.target = list(self.q)
            self.stopped(now, "the command has expired")
        share = 1.0 - math.exp(-dt / LAG)
        for i, goal in enumerate(self.target):
            way = max(-FASTEST * dt, min(FASTEST * dt, share * (goal - self.q[i])))
            self.q[i] += way
            self.v[i] = way / dt
        note = self.fault
        if note is not None:
            note["far"] = max(note["far"], *(abs(a - b) for a, b in zip(self.q, note["q"], strict=True)))
            note["fastest"] = max(note["fastest"], *map(abs, self.v))
            if note["held"] is not None:
                if max(map(abs, self.v)) < STILL:
                    note["still"] = note["still"] or now
                else:
                    note["still"] = None


class Server:
    """The sockets, and what faults do to joint states."""

    def __init__(self, names: list[str]) -> None:
        self.arm = Arm(names)
        self.listening = socket.create_server(("127.0.0.1", 0))
        self.pieces: dict[socket.socket, bytes] = {}
        self.states: list[socket.socket] = []
        self.delayed: deque[tuple[float, bytes]] = deque()

    def serve(self) -> None:
        print(self.listening.getsockname()[1], flush=True)
        last = next_state = time.monotonic()
        while True:
            ready = select.select([self.listening, *self.pieces], [], [], STEP)[0]
            for sock in ready:
                self.read(sock)
            now = time.monotonic()
            if now > last:
                self.arm.busy = max(self.arm.busy, now - last)
                self.arm.advance(now, now - last)
                last = now
            if now >= next_state:
                next_state = max(next_state + STATES, now)
                self.publish(now)

    def read(self, sock: socket.socket) -> None:
        if sock is self.listening:
            peer = sock.accept()[0]
            peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.pieces[peer] = b""
            return
        try:
            data = sock.recv(1 << 16)
        except OSError:
            data = b""
        if not data:
            self.forget(sock)
            return
        *lines, self.pieces[sock] = (self.pieces[sock] + data).split(b"\n")
        for line in lines:
            self.obey(json.loads(line), sock)

    def obey(self, message: dict, sock: socket.socket) -> None:
        now = time.monotonic()
        if "states" in message:
            self.states.append(sock)
        elif "fault" in message:
            self.arm.inject(message["fault"], now)
            if message["fault"] == "drop":
                for state in list(self.states):
                    self.forget(state)
            if message["fault"] == "estop":
                self.send({"estop": "the red button"})
        elif "tell" in message:
            arm = self.arm
            told = {
                "fault": arm.fault, "q": arm.q, "v": arm.v, "latched": arm.latched, "now": now,
                "commands": arm.commands, "refused": arm.refused, "busy": arm.busy,
                "here": arm.here,
            }  # fmt: skip
            arm.busy = 0.0
            sock.sendall(json.dumps(told).encode() + b"\n")
        else:
            self.arm.take(message, now)

    def publish(self, now: float) -> None:
        arm = self.arm
        fault = arm.fault["name"] if arm.fault else ""
        names, q, v = arm.names, list(arm.q), list(arm.v)
        if fault == "silent":
            return
        if fault == "frozen":
            q = arm.fault["q"]
        if fault == "nan":
            q[2] = math.nan
        if fault == "order":
            names = [names[1], names[0], *names[2:]]
        if fault == "mixed":
            q = [q[1], q[0], *q[2:]]
        line = {"names": names, "q": q, "v": v, "stamp": now}
        if fault == "delayed":
            self.delayed.append((now + 0.3, line))
            while self.delayed and self.delayed[0][0] <= now:
                self.send(self.delayed.popleft()[1])
        else:
            self.send(line)

    def send(self, message: dict) -> None:
        line = json.dumps(message).encode() + b"\n"
        for sock in list(self.states):
            try:
                sock.sendall(line)
            except OSError:
                self.forget(sock)

    def forget(self, sock: socket.socket) -> None:
        self.pieces.pop(sock, None)
        if sock in self.states:
            self.states.remove(sock)
        sock.close()


if __name__ == "__main__":
    Server(sys.argv[1:]).serve()
