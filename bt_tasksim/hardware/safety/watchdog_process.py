"""The watchdog's own process: no sign of life from the runner for some time, or no runner: the robot holds.

It reads from its standard input one JSON line that says how to reach the robot, and then records of nine
bytes: a letter and a time of the monotonic clock. ``B`` is a heartbeat, and the first one begins the watch;
``D`` ends it, ``H`` asks for a hold at once. The end of the input is the end of the runner. On its standard
output it answers what it has read with the byte `ECHO`, and says what it did, one line each, beginning with
``ready``, ``held`` or ``failed``. It imports the standard library and what the channel needs, and nothing
else, so that whatever happens to the runner, this goes on.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import math
import os
import select
import signal
import struct
import sys
import time
from typing import Any

RECORD = struct.Struct("<cd")
HEARTBEAT, DONE, HOLD = b"B", b"D", b"H"
ECHO = b"\x06"


class Watch:
    """When to hold; time comes from outside.

    Args:
        deadline: Seconds without a heartbeat.
    """

    def __init__(self, deadline: float) -> None:
        self.deadline = deadline
        self.watching = False
        self._last = 0.0
        self._rest = b""

    def feed(self, data: bytes) -> bool:
        """Take in what the runner wrote; says whether it asks for a hold, as a record that is none does."""
        data = self._rest + data
        whole = len(data) - len(data) % RECORD.size
        self._rest = data[whole:]
        asked = False
        for kind, when in RECORD.iter_unpack(data[:whole]):
            if kind not in (HEARTBEAT, DONE, HOLD) or not math.isfinite(when):
                asked = True
                continue
            self.watching = kind == HEARTBEAT
            self._last = when
            asked = asked or kind == HOLD
        return asked

    def left(self, now: float) -> float | None:
        """Seconds until the deadline; None while nothing is watched."""
        return self._last + self.deadline - now if self.watching else None

    def silence(self, now: float) -> float:
        """Seconds since the last heartbeat."""
        return now - self._last


def main() -> int:
    """Watch until the runner ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    setting = json.loads(_line(0))
    try:
        module, _, name = setting["factory"].partition(":")
        channel: Any = getattr(importlib.import_module(module), name)(**setting["arguments"])
        channel.open()
    except Exception as error:
        _say(f"failed {type(error).__name__}: {error}")
        return 1
    _say("ready")
    os.set_blocking(1, False)  # a runner that does not listen must not keep this from its watch
    watch = Watch(float(setting["deadline"]))

    def hold(why: str) -> None:
        watch.watching = False
        try:
            channel.hold(why)
        except Exception as error:  # whatever a channel raises, the watch goes on
            _say(f"failed {why}, and the robot cannot be told: {error}")
        else:
            _say(f"held {why}")

    while True:
        left = watch.left(time.monotonic())
        ready = select.select([0], [], [], None if left is None else max(left, 0.0))[0]
        if ready:
            data = os.read(0, 1 << 16)
            if not data:
                if watch.watching:
                    hold("the runner is gone")
                return 0
            if watch.feed(data):
                hold("the runner asked for it")
            with contextlib.suppress(OSError):
                os.write(1, ECHO)
        now = time.monotonic()
        left = watch.left(now)
        if left is not None and left <= 0.0:
            hold(f"no sign of life from the runner for {1000 * watch.silence(now):.0f} ms")


def _line(file: int) -> bytes:
    """One line, read byte by byte: what follows it stays in the pipe."""
    line = b""
    while not line.endswith(b"\n") and (byte := os.read(file, 1)):
        line += byte
    return line


def _say(text: str) -> None:
    """A line for the runner, and for the terminal: the runner may be gone."""
    line = " ".join(text.split()) + "\n"
    with contextlib.suppress(OSError):
        os.write(1, line.encode())
    if not text.startswith("ready"):
        with contextlib.suppress(OSError):
            os.write(2, f"bt-tasksim watchdog: {line.partition(' ')[2]}".encode())


if __name__ == "__main__":
    sys.exit(main())
