"""The watchdog's way to a robot behind rosbridge: a connection of its own, by the standard library alone."""

from __future__ import annotations

import contextlib
import json
import math
import threading
import time
from typing import Any

from bt_tasksim.engines.ros.websocket import WebSocket

FRESH = 0.5
"""Seconds for which a position counts as the robot's present one."""
STOP = 0.1
"""Seconds in which the arm is told to come to stand."""
AGAIN = 0.5
"""Seconds between two attempts to connect again."""
EVERY = 20
"""Milliseconds between two joint states that are looked at."""


class RosHold:
    """A `HoldChannel`: one point where the arm is, as a trajectory, and the word to hold where there is one.

    Args:
        host: Where rosbridge is.
        port: Its port.
        states: Topic of the joint states.
        command: Topic of the arm's trajectories.
        joints: The arm's joints, as they are named there.
        word: Topic that says hold; empty where there is none.
    """

    def __init__(self, host: str, port: int, states: str, command: str, joints: list[str], word: str) -> None:
        self._host, self._port = host, port
        self._states, self._command, self._joints, self._word = states, command, joints, word
        self._lock = threading.Lock()
        self._socket: WebSocket | None = None
        self._position: tuple[float, list[float]] | None = None

    def open(self) -> None:
        """See `HoldChannel.open`."""
        with self._lock:
            socket = WebSocket(self._host, self._port)
            self.close()
            self._socket = socket
            for topic, kind in (
                (self._command, "trajectory_msgs/JointTrajectory"),
                (self._word, "std_msgs/String"),
            ):
                if topic:
                    self._say({"op": "advertise", "topic": topic, "type": kind})
            states = {"topic": self._states, "type": "sensor_msgs/JointState"}
            self._say({"op": "subscribe", **states, "throttle_rate": EVERY, "queue_length": 1})
        threading.Thread(target=self._listen, args=(socket,), daemon=True).start()

    def hold(self, why: str) -> None:
        """See `HoldChannel.hold`; connects again where the connection was lost."""
        try:
            self._hold(why)
        except OSError:
            self.open()
            time.sleep(0.2)  # until whoever listens has found this new publisher
            self._hold(why)

    def close(self) -> None:
        """See `HoldChannel.close`."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _hold(self, why: str) -> None:
        if self._word:
            self._say({"op": "publish", "topic": self._word, "msg": {"data": f"watchdog: {why}"[:400]}})
        known = self._position
        if known is None or time.monotonic() - known[0] > FRESH:
            if not self._word:
                raise OSError("where the arm is is not known, and the robot takes no word to hold")
        else:
            point = {"positions": known[1], "velocities": [0.0] * len(self._joints)}
            point["time_from_start"] = {"sec": 0, "nanosec": round(STOP * 1e9)}  # type: ignore[assignment]
            message = {"joint_names": self._joints, "points": [point]}
            self._say({"op": "publish", "topic": self._command, "msg": message})

    def _say(self, message: dict[str, Any]) -> None:
        if self._socket is None:
            raise OSError("not connected")
        self._socket.send(json.dumps(message))

    def _listen(self, socket: WebSocket) -> None:
        """Remember where the arm is; on a thread of its own, until the connection ends."""
        while socket is self._socket:
            try:
                text = socket.receive()
            except OSError:
                self._connect_again(socket)
                return
            position = _position(text, self._joints)
            if position is not None:
                self._position = (time.monotonic(), position)

    def _connect_again(self, lost: WebSocket) -> None:
        """A bridge that was started anew is connected to, so that a hold need not wait for that."""
        while self._socket is lost:
            time.sleep(AGAIN)
            with contextlib.suppress(OSError):
                if self._socket is lost:
                    self.open()


def _position(text: str | None, joints: list[str]) -> list[float] | None:
    """Positions of joints in a message of rosbridge; None where it does not say them."""
    try:
        message = json.loads(text or "")["msg"]
        found = dict(zip(message["name"], message["position"], strict=True))
        position = [float(found[name]) for name in joints]
    except (ValueError, TypeError, KeyError):
        return None
    return position if all(map(math.isfinite, position)) else None
