"""The client's side of a served engine: one connection, one request at a time, each with a time limit."""

from __future__ import annotations

import dataclasses
import math
import time
import weakref
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import zmq
from zmq.utils.monitor import recv_monitor_message

from bt_tasksim.core.errors import InputError, LostEngine, MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.images import Image
from bt_tasksim.engines.remote.address import Address
from bt_tasksim.engines.remote.handshake import Identity, identity, mismatch
from bt_tasksim.engines.remote.keys import Key
from bt_tasksim.engines.remote.messages import Message, OtherProtocolError, decode, encode
from bt_tasksim.engines.remote.schema import Frame, sizes_of
from bt_tasksim.engines.remote.session import error_of
from bt_tasksim.engines.remote.sockets import end, prepare, receive, send
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

_AGAIN = 100
"""Milliseconds between two tries to connect, while a server starts."""
_TRIES = 3
"""Connections that break off without a reason, as those to a server that is just ending or starting."""
_EVENTS = (
    zmq.EVENT_HANDSHAKE_SUCCEEDED
    | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL
    | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL
    | zmq.EVENT_HANDSHAKE_FAILED_AUTH
    | zmq.EVENT_DISCONNECTED
)
"""What a client wants to know of its connection; after the second and third failure ZeroMQ tries no more."""


@dataclass(frozen=True)
class Limits:
    """How long a client waits for an answer, in seconds.

    Attributes:
        connect: For the server to be there and say hello.
        step: For one step of physics, kinematics or post-process.
        slow: For what takes long in its nature: a new episode, a picture. A server that has gone away is
            noticed at once all the same.
    """

    connect: float = 5.0
    step: float = 2.0
    slow: float = 60.0


class Connection:
    """A connection to a served engine, which it owns until it is closed.

    After any failure it is of no use any more; `open` begins anew.

    Args:
        address: Where the server is.
        role: The role that its engine must have.
        robot: The robot that it must be for.
        key: The client's key; must be given for a server on another machine.
        limits: How long to wait.

    Raises:
        InputError: There is no key and one is needed, or the server is not one for this client.
        LostEngine: The server is not there, has another key, or is in use.
    """

    def __init__(
        self,
        address: Address,
        role: str,
        robot: RobotDescription,
        key: Key | None = None,
        limits: Limits | None = None,
    ) -> None:
        if not address.loopback and key is None:
            raise InputError(
                f"the {role} server at {address} is on another machine: give the client's key, --key FILE"
            )
        self.address, self.role, self.robot, self.key = address, role, robot, key
        self.limits = limits or Limits()
        self.engine, self.wants_images = "", False
        self._pictures = role == "rendering"
        self._sizes = sizes_of(robot)
        self._end: weakref.finalize[..., Connection] | None = None
        self._why = ""
        self.open()

    @property
    def server(self) -> str:
        """How sentences name the other side."""
        return f"the {self.role} server at {self.address}"

    @property
    def broken(self) -> bool:
        """Something has failed, and `open` is needed."""
        return self._end is None

    def open(self) -> None:
        """Connect and say hello, as a new client."""
        self.close()
        self._number, self._tries, self._shaken, self._why = 0, 0, False, ""
        context = zmq.Context()
        self._socket = context.socket(zmq.DEALER)
        prepare(self._socket, self.key, pictures=self._pictures, server=False)
        self._socket.setsockopt(zmq.RECONNECT_IVL, _AGAIN)
        self._monitor = self._socket.get_monitor_socket(_EVENTS)
        self._end = weakref.finalize(self, end, context, self._socket, self._monitor)
        self._poller = zmq.Poller()
        self._poller.register(self._socket, zmq.POLLIN)
        self._poller.register(self._monitor, zmq.POLLIN)
        ours = identity(self.role, self.robot)
        try:
            self._socket.connect(self.address.url)
        except zmq.ZMQError as error:
            raise self._fail(f"{self.server} cannot be reached: {error.strerror}") from None
        reply = self.request("hello", "welcome", self.limits.connect, dataclasses.asdict(ours))
        self.engine = reply.fields["engine"]
        self.wants_images = reply.fields["wants_images"]
        theirs = Identity(**{f.name: reply.fields[f.name] for f in dataclasses.fields(Identity)})
        if why := mismatch(theirs, ours):
            self.close()
            raise InputError(f"{self.server}: {why}")

    def close(self) -> None:
        """End the connection; the engine is free for another client."""
        if self._end is not None:
            self._end()
            self._end = None

    def begin(self, configuration: ActorConfiguration) -> None:
        """Note the sizes of arrays in a new episode's world."""
        self._sizes = sizes_of(self.robot, configuration)

    def request(
        self,
        kind: str,
        replies: str | Collection[str],
        limit: float,
        fields: Mapping[str, Any] | None = None,
        arrays: Mapping[str, Array] | None = None,
        images: Sequence[Image] = (),
    ) -> Message:
        """Ask, and wait for the answer.

        Args:
            kind: What is asked, see `schema.REQUESTS`.
            replies: The kind or kinds of answer that there may be.
            limit: Seconds to wait.
            fields: Fields of the message.
            arrays: Its arrays.
            images: Its images.

        Returns:
            The answer.

        Raises:
            InputError: The engine raised it, the world cannot be sent as it is, or the two sides differ.
            MachineError: The engine raised it, or it would be asked for nonsense, such as NaN.
            LostEngine: The server has gone, is too slow, answers nonsense, or serves another client.
        """
        if self.broken:
            raise LostEngine(self._why or f"the connection to {self.server} is closed")
        self._number += 1
        message = Message(self._number, kind, fields or {}, arrays or {}, tuple(images))
        try:
            frames = encode(message, self._sizes)
        except InputError as error:
            if kind == "reset":
                raise
            raise MachineError(f"{self.server} cannot be asked to '{kind}': {error}") from error
        expected = (replies,) if isinstance(replies, str) else tuple(replies)
        try:
            reply = self._exchange(frames, kind, (*expected, "error", "notice"), limit)
        except BaseException:
            self.close()  # an answer may still be on its way: nothing that comes now belongs to what is asked
            raise
        if reply.kind != "error":
            return reply
        if kind == "hello":
            self.close()
        raise error_of(reply)

    def _exchange(
        self, frames: Sequence[Frame], kind: str, replies: Collection[str], limit: float
    ) -> Message:
        deadline = time.monotonic() + limit
        self._look_at_connection()
        try:
            send(self._socket, frames, zmq.NOBLOCK)
        except zmq.ZMQError as error:
            raise self._fail(f"{self.server} takes no more messages ({error.strerror})") from None
        while True:
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise self._fail(self._too_late(kind, limit))
            ready = dict(self._poller.poll(math.ceil(1000.0 * left)))
            if self._socket in ready:
                try:
                    reply = decode(receive(self._socket, self._pictures), replies, self._sizes)
                except InputError as error:
                    if kind == "hello" and isinstance(error, OtherProtocolError):
                        raise InputError(f"{self.server}: {error}") from None
                    raise self._fail(f"{self.server} answers nonsense: {error}") from None
                if reply.number == self._number:
                    return reply
                if reply.kind == "error" and reply.number == 0:
                    if kind == "hello":  # the same protocol by number only
                        raise InputError(f"{self.server}: {reply.fields['sentence']}")
                    raise self._fail(f"{self.server} did not understand: {reply.fields['sentence']}")
            elif self._monitor in ready:
                self._look_at_connection()

    def _look_at_connection(self) -> None:
        """Read what became of the connection.

        Raises:
            LostEngine: It broke off.
        """
        while self._monitor.poll(0):
            event = recv_monitor_message(self._monitor)["event"]
            if event == zmq.EVENT_HANDSHAKE_SUCCEEDED:
                self._shaken = True
            elif self._shaken:
                raise self._fail(
                    f"{self.server} has gone away: it was stopped, or the connection was cut; "
                    "start it again, and begin a new run"
                )
            elif event != zmq.EVENT_DISCONNECTED:  # that one follows each of the others
                self._tries += 1
                if self._tries >= _TRIES or event != zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL:
                    raise self._fail(self._broke_off())

    def _too_late(self, kind: str, limit: float) -> str:
        if self._shaken:
            return f"{self.server} did not answer '{kind}' within {limit:g} s: it hangs, or is too slow"
        if self._tries:
            return self._broke_off()
        return (
            f"no {self.role} server answers at {self.address} within {limit:g} s: start one there with "
            f"'bt-tasksim serve-engine {self.role} NAME --port {self.address.port}', or look at the key and "
            "the firewall"
        )

    def _broke_off(self) -> str:
        wants = "has another key, or none" if self.key else "wants a key (--key FILE)"
        return f"{self.server} broke off: it {wants}, or is no such server"

    def _fail(self, why: str) -> LostEngine:
        self._why = why
        return LostEngine(why)
