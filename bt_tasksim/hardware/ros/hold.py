"""The watchdog's way to a robot behind rosbridge: a connection of its own, by the standard library alone."""

from __future__ import annotations

import contextlib
import json
import math
import threading
import time
from typing import Any, NamedTuple

from bt_tasksim.hardware.ros.websocket import WebSocket

FRESH = 0.1
"""Seconds for which a position counts as the robot's present one."""
STOP = 0.1
"""Least seconds in which the arm is told to come to stand."""
AGAIN = 0.5
"""Seconds between two attempts to connect again."""
EVERY = 20
"""Milliseconds between two joint states that are looked at."""
UNUSABLE = (ValueError, TypeError, KeyError, OverflowError, RecursionError)
"""What a message leads to that is none: no JSON, none of these fields, deep, or numbers of 400 digits."""


class JointSample(NamedTuple):
    """Joints at a time, seconds of `time.monotonic`: position in rad, velocity in rad/s."""

    time: float
    position: list[float]
    velocity: list[float]


class RosHold:
    """A `HoldChannel`: one point where the arm can stand, as a trajectory, and the word to hold.

    Args:
        host: Where rosbridge is.
        port: Its port.
        states: Topic of the joint states.
        command: Topic of the arm's trajectories.
        joints: The arm's joints, as they are named there.
        word: Topic that says hold; empty where there is none.
        speed: What the joints can do, rad/s; a report of more is not believed.
        acceleration: With which the joints may brake, rad/s^2.
        lower: Their position limits, rad.
        upper: Likewise.
    """

    def __init__(
        self,
        host: str,
        port: int,
        states: str,
        command: str,
        joints: list[str],
        word: str,
        speed: list[float],
        acceleration: list[float],
        lower: list[float],
        upper: list[float],
    ) -> None:
        self._limits = list(zip(speed, acceleration, lower, upper, strict=True))
        self._host, self._port = host, port
        self._states, self._command, self._joints, self._word = states, command, joints, word
        self._lock = threading.Lock()
        self._socket: WebSocket | None = None
        self._known: JointSample | None = None

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
        known = self._known
        if known is None or time.monotonic() - known.time > FRESH:
            if not self._word:
                raise OSError("where the arm is is not known, and the robot takes no word to hold")
        else:
            message = {"joint_names": self._joints, "points": [_standing(known, self._limits)]}
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
            try:
                found = _motion(text, self._joints, time.monotonic(), self._known)
            except Exception:  # whatever it was: who listens here outlives every message
                continue
            self._known = found or self._known

    def _connect_again(self, lost: WebSocket) -> None:
        """A bridge that was started anew is connected to, so that a hold need not wait for that."""
        while self._socket is lost:
            time.sleep(AGAIN)
            with contextlib.suppress(Exception):  # the next attempt may do better
                if self._socket is lost:
                    self.open()


def _motion(
    text: str | None, joints: list[str], now: float, before: JointSample | None
) -> JointSample | None:
    """Joints as a message of rosbridge says them; None where it does not.

    Where it says no speeds they follow from the way since the last message.

    Args:
        text: The message.
        joints: Names.
        now: When it came, seconds of `time.monotonic`.
        before: The last one.
    """
    try:
        message = json.loads(text or "")["msg"]
        found = dict(zip(message["name"], message["position"], strict=True))
        position = [_number(found[name]) for name in joints]
    except UNUSABLE:
        return None
    try:
        found = dict(zip(message["name"], message["velocity"], strict=True))
        velocity = [_number(found[name]) for name in joints]
    except UNUSABLE:
        velocity = [0.0] * len(joints)
        if before is not None and EVERY / 2000 < now - before.time < FRESH:
            way = zip(position, before.position, strict=True)
            velocity = [(a - b) / (now - before.time) for a, b in way]
    return JointSample(now, position, velocity) if all(map(math.isfinite, position + velocity)) else None


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError
    return float(value)


def _standing(motion: JointSample, limits: list[tuple[float, float, float, float]]) -> dict[str, Any]:
    """The point of a trajectory where joints that brake evenly come to stand; see `messages.standing`.

    Args:
        motion: Where they are, and how fast.
        limits: Speed, acceleration, lower and upper limit of each.
    """
    believed = zip(motion.velocity, limits, strict=True)
    speeds = [min(max(speed, -most), most) for speed, (most, _, _, _) in believed]
    braking = max([STOP, *(abs(speed) / limit[1] for speed, limit in zip(speeds, limits, strict=True))])
    rest = []
    for here, speed, (_, _, lower, upper) in zip(motion.position, speeds, limits, strict=True):
        rest.append(min(max(here + speed * braking / 2.0, min(lower, here)), max(upper, here)))
    nanoseconds = round(braking * 1e9)
    after = {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
    return {"positions": rest, "velocities": [0.0] * len(rest), "time_from_start": after}
