"""The runner's side of the watchdog: starts its process, feeds it, and notices when it has acted or died."""

from __future__ import annotations

import contextlib
import json
import math
import os
import select
import subprocess
import sys
import time
from dataclasses import asdict

from bt_tasksim.core import child
from bt_tasksim.core.errors import MachineError
from bt_tasksim.hardware.safety.engine import ChannelSpec
from bt_tasksim.hardware.safety.watchdog_process import DONE, ECHO, HEARTBEAT, HOLD, RECORD

START = 20.0
"""Longest time in seconds that the process may take to start."""


class Watchdog:
    """A process that stops the robot when this one gives no sign of life.

    It has a session of its own, so that Ctrl-C in a terminal does not reach it.

    Args:
        channel: How it stops the robot.
        deadline: Seconds without a heartbeat.

    Raises:
        MachineError: It cannot start, or cannot reach the robot.
    """

    def __init__(self, channel: ChannelSpec, deadline: float) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "bt_tasksim.hardware.safety.watchdog_process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,
            env={**os.environ, **child.VARIABLES, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        )
        assert self._process.stdin is not None and self._process.stdout is not None
        self._in, self._out = self._process.stdin.fileno(), self._process.stdout.fileno()
        self._heard, self._why = b"", ""
        self._deadline, self._unanswered = deadline, math.inf
        setting = {**asdict(channel), "deadline": deadline}
        try:
            os.write(self._in, json.dumps(setting).encode() + b"\n")
            said = self._first_line()
        except BaseException as error:
            self.close()
            if isinstance(error, OSError):
                raise MachineError(f"the watchdog's process does not start: {error}") from error
            raise
        os.set_blocking(self._in, False)
        os.set_blocking(self._out, False)
        if said != "ready":
            self.close()
            why = said.removeprefix("failed ") or "it ended"
            raise MachineError(f"the watchdog cannot reach the robot: {why}; nothing was moved")

    @property
    def pid(self) -> int:
        """Number of its process."""
        return self._process.pid

    def heartbeat(self) -> None:
        """Give a sign of life; the first one begins the watch."""
        self._unanswered = min(self._unanswered, time.monotonic())
        self._write(HEARTBEAT)

    def rest(self) -> None:
        """End the watch, until the next heartbeat."""
        self._unanswered = math.inf
        self._write(DONE)

    def hold(self) -> bool:
        """Have it stop the robot now; says whether its process is there. Another one is needed after that."""
        self._write(HOLD)
        self._why = self._why or "the watchdog was told to stop the robot"
        return self._process.poll() is None

    def trouble(self) -> str:
        """What is wrong, as a sentence: it has stopped the robot, hangs, or is gone; empty if all is well."""
        if self._why:
            return self._why
        with contextlib.suppress(BlockingIOError):
            self._heard += os.read(self._out, 1 << 16)
        if ECHO in self._heard:
            self._heard, self._unanswered = self._heard.replace(ECHO, b""), math.inf
        silent = time.monotonic() - self._unanswered
        if b"\n" in self._heard:
            word, _, why = self._heard.partition(b"\n")[0].decode().partition(" ")
            self._why = f"the watchdog has stopped the robot: {why}" if word == "held" else f"watchdog: {why}"
        elif self._process.poll() is not None:
            self._why = "the watchdog's process has ended"
        elif silent > self._deadline:
            self._why = f"the watchdog does not answer for {1000 * silent:.0f} ms"
        return self._why

    def close(self) -> None:
        """End its process."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        try:
            self._process.wait(1.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _write(self, kind: bytes) -> None:
        try:
            os.write(self._in, RECORD.pack(kind, time.monotonic()))
        except OSError:  # its end of the pipe is closed, or it has stopped to read
            self._why = self._why or "the watchdog's process has ended"

    def _first_line(self) -> str:
        end, line = time.monotonic() + START, b""
        while not line.endswith(b"\n"):
            left = end - time.monotonic()
            if left <= 0.0 or not select.select([self._out], [], [], left)[0]:
                raise TimeoutError(f"it has said nothing for {START:g} s")
            piece = os.read(self._out, 1)
            if not piece:
                break
            line += piece
        return line.decode().strip()
