"""A connection to rosbridge: what arrives is handed on, what goes out is the newest or nothing."""

from __future__ import annotations

import contextlib
import logging
import math
import threading
import time
from collections.abc import Callable
from typing import Any

from bt_tasksim.core.errors import MachineError
from bt_tasksim.engines.remote.address import Address
from bt_tasksim.hardware.ros.messages import UnusableMessageError

LOG = logging.getLogger("bt_tasksim.ros")
PATIENCE = 5.0
"""Seconds within which the bridge must be there."""
EVERY = 1.0
"""Seconds between two sentences about messages of one topic."""


class Complaints:
    """Says what is wrong with messages, once a second a topic at most.

    Args:
        say: Takes a sentence.
    """

    def __init__(self, say: Callable[[str], None] = LOG.warning) -> None:
        self._say = say
        self._last: dict[str, tuple[float, int]] = {}

    def about(self, topic: str, why: str) -> None:
        """A message of a topic was not used."""
        now = time.monotonic()
        then, more = self._last.get(topic, (-EVERY, 0))
        if now - then < EVERY:
            self._last[topic] = (then, more + 1)
            return
        self._last[topic] = (now, 0)
        self._say(f"{topic}: {why}" + (f" (and {more} more since the last such line)" if more else ""))


class Link:
    """A connection to rosbridge by roslibpy, made once: when it is lost it stays so.

    Attributes:
        lost: Why there is no connection any more; empty while there is one.

    Args:
        address: Where the bridge is.
        complain: Takes a sentence about a message that is not used.

    Raises:
        MachineError: roslibpy is not installed, or there is no bridge.
    """

    def __init__(self, address: Address, complain: Callable[[str], None] = LOG.warning) -> None:
        try:
            import roslibpy
        except ImportError as error:
            raise MachineError(
                f"a robot is reached through the extra 'ros' ({error}): pip install 'bt-tasksim[ros]'"
            ) from error
        self.address, self.lost = address, ""
        self._roslibpy = roslibpy
        self._complaints = Complaints(complain)
        self._topics: dict[str, Any] = {}
        self._slots: dict[str, tuple[dict[str, Any] | None, float]] = {}
        self._lock = threading.Lock()
        logging.getLogger("roslibpy").setLevel(logging.CRITICAL)  # what it would say is said here
        self._ros: Any = roslibpy.Ros(address.host, address.port, transport="asyncio")
        self._ros.factory.maxRetries = 0  # nothing is sent late on a connection that came back by itself
        self._ros.on("close", self._closed)
        # JSON's reader looks at the encoding, too; in pure Python a second look takes longer than the rest.
        self._ros.factory.on_ready(lambda protocol: setattr(protocol, "utf8validateIncoming", False))
        try:
            self._ros.run(timeout=PATIENCE)
        except Exception as error:
            self.lost = "there is no connection"
            self._ros.factory.on_ready(lambda protocol: protocol.send_close())
            raise MachineError(
                f"no rosbridge answers at {address} within {PATIENCE:g} s: is it started there?"
            ) from error

    def subscribe(
        self, topic: str, kind: str, handle: Callable[[Any, float], None], throttle: int = 0
    ) -> None:
        """Have every message handed on with the time of its arrival, on the connection's thread.

        Args:
            topic: Its name.
            kind: Its type, such as ``sensor_msgs/JointState``.
            handle: Takes the message; raises `UnusableMessageError` where it is not one.
            throttle: Least milliseconds between two messages; the newest one counts.
        """

        def arrived(message: Any) -> None:
            try:
                handle(message, time.monotonic())
            except UnusableMessageError as error:
                self._complaints.about(topic, str(error))
            except Exception as error:  # a message must never end the connection's thread
                self._complaints.about(topic, f"{type(error).__name__}: {error}")

        options = {"throttle_rate": throttle, "queue_length": 1 if throttle else 0}
        made = self._roslibpy.Topic(self._ros, topic, kind, reconnect_on_close=False, **options)
        self._topics[f"from {topic}"] = made
        made.subscribe(arrived)

    def advertise(self, topic: str, kind: str) -> None:
        """Say that messages of a type will be published."""
        made = self._roslibpy.Topic(self._ros, topic, kind, reconnect_on_close=False)
        self._topics[topic] = made
        made.advertise()

    def publish(self, topic: str, message: dict[str, Any], within: float = math.inf) -> None:
        """Publish a message on an advertised topic; one that has not left yet is replaced by it.

        Args:
            topic: Its name.
            message: The message.
            within: Seconds in which it must leave this process; it is dropped then.

        Raises:
            MachineError: The connection is lost.
        """
        if self.lost:
            raise MachineError(self.lost)
        with self._lock:
            waiting = topic in self._slots
            self._slots[topic] = (message, time.monotonic() + within)
        if not waiting:
            loop = self._ros.factory.manager.loop
            loop.call_soon_threadsafe(self._leave, topic)

    def _leave(self, topic: str) -> None:
        with self._lock:
            message, until = self._slots.pop(topic, (None, 0.0))
        if message is not None and not self.lost and time.monotonic() <= until:
            self._topics[topic].publish(self._roslibpy.Message(message))

    def _closed(self, _: Any) -> None:
        self.lost = self.lost or f"the connection to rosbridge at {self.address} is lost"

    def close(self) -> None:
        """Disconnect."""
        self.lost = self.lost or "the connection was closed"
        with contextlib.suppress(Exception):
            self._ros.close()
