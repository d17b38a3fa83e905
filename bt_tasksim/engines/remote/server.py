"""The process that serves an engine: one socket, one loop, one message after the other."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable
from typing import Any

import zmq
from zmq.utils import z85
from zmq.utils.monitor import recv_monitor_message

from bt_tasksim.engines.remote.address import Address
from bt_tasksim.engines.remote.keys import Key
from bt_tasksim.engines.remote.memory import MemoryWatch
from bt_tasksim.engines.remote.session import Session
from bt_tasksim.engines.remote.sockets import end, prepare, receive, send
from bt_tasksim.errors import InputError, MachineError

_WAKE = 200
"""Milliseconds after which the loop looks whether it should stop."""
_PROBES = (0.0, 0.02, 0.1)
"""Seconds before each look at whether an owner is still there: a closed connection takes a moment to show."""
_ZAP = "inproc://zeromq.zap.01"
_FAILED = {
    zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL,
    zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL,
    zmq.EVENT_HANDSHAKE_FAILED_AUTH,
}


class EngineServer:
    """Serves one engine until it is told to stop.

    Args:
        session: The engine.
        address: Where to listen; port 0 takes a free one.
        key: The server's key; must be given where others than this machine can connect.
        refused: Called with one sentence for each connection that is refused.
        memory: Bytes that unfinished messages may take up before all connections are cut.

    Raises:
        InputError: Other machines could connect and there is no key.
        MachineError: The address is taken or is none of this machine.
    """

    def __init__(
        self,
        session: Session,
        address: Address,
        key: Key | None = None,
        refused: Callable[[str], None] = lambda sentence: None,
        memory: int = 1 << 30,
    ) -> None:
        check_address(address, key)
        self.session, self.key, self.memory, self._refused = session, key, memory, refused
        self.address = address
        self._pictures = session.role == "postprocess"
        self._look = self._probed = 0.0
        self._open()

    def _open(self) -> None:
        """Listen, without any client yet."""
        context = zmq.Context()
        self._socket = context.socket(zmq.ROUTER)
        self._monitor = self._socket.get_monitor_socket(sum(_FAILED))
        self._gate = context.socket(zmq.REP)
        self._end = weakref.finalize(self, end, context, self._socket, self._monitor, self._gate)
        address = self.address
        try:
            if self.key is not None:  # first of all: where nobody answers there, CURVE lets every key in
                self._gate.bind(_ZAP)
            prepare(self._socket, self.key, pictures=self._pictures, server=True)
            self._socket.setsockopt(zmq.ROUTER_MANDATORY, 1)
            self._socket.bind(address.url)
            bound = self._socket.getsockopt_string(zmq.LAST_ENDPOINT)
            self.address = Address(address.host, int(bound.rpartition(":")[2]))
        except zmq.ZMQError as error:
            self.close()
            raise MachineError(
                f"cannot listen at {address}: {error.strerror}; choose another --port or --address"
            ) from None
        self._poller = zmq.Poller()
        for socket in (self._socket, self._monitor, self._gate):
            self._poller.register(socket, zmq.POLLIN)
        self._watch = MemoryWatch()

    @property
    def sentence(self) -> str:
        """One line about what is served where and to whom."""
        who = (
            "encrypted, for the holders of the client's key"
            if self.key
            else "this machine only, not encrypted"
        )
        about = self.session
        return f"{about.role} '{about.name}' for {about.robot.name} at {self.address} ({who})"

    def serve(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Answer messages until `stopped` says so, or an interrupt ends it."""
        while not stopped():
            ready = dict(self._poller.poll(_WAKE))
            if self._gate in ready:
                self._answer_gate()
            if self._monitor in ready:
                self._read_monitor()
            if self._socket in ready:
                self._answer()
            self._watch_memory()

    def close(self) -> None:
        """Let go of the port and of every client."""
        self._end()

    def _answer(self) -> None:
        client, *frames = receive(self._socket, self._pictures)
        name = bytes(client)
        with self._watch.own():
            reply = self.session.answer(name, frames, self._there)
        self._send(name, reply)

    def _send(self, client: bytes, frames: list[Any]) -> bool:
        """Send to a client that is still there and listens; says whether it could be."""
        try:
            send(self._socket, [client, *frames], zmq.NOBLOCK)
        except zmq.ZMQError:  # it has gone, or does not read what it is sent
            return False
        return True

    def _there(self, client: bytes) -> bool:
        now = time.monotonic()
        patient, self._probed = now - self._probed > 1.0, now  # its owner's steps wait meanwhile
        for wait in _PROBES if patient else _PROBES[:1]:
            time.sleep(wait)
            if not self._send(client, self.session.notice()):
                return False
        return True

    def _watch_memory(self) -> None:
        """Cut every connection where unfinished messages fill the memory."""
        now = time.monotonic()
        if now < self._look:
            return
        self._look = now + _WAKE / 1000.0
        if self._watch.strange() > self.memory:
            self._refused(f"messages without end, {self.memory >> 20} MiB of them: all connections were cut")
            self.close()
            self._open()

    def _read_monitor(self) -> None:
        recv_monitor_message(self._monitor)
        self._refused(
            "a connection whose other side does not speak the protocol"
            + (" or has not the right key" if self.key else ", or wants encryption where there is none")
        )

    # ---- who may come in: ZeroMQ's authentication protocol, rfc.zeromq.org/spec/27 ----------------------

    def _answer_gate(self) -> None:
        assert self.key is not None
        asked = self._gate.recv_multipart()
        version, request, credentials = asked[0], asked[1], asked[6:]
        allowed = asked[5] == b"CURVE" and credentials == [z85.decode(self.key.peer)]
        status, text = (b"200", b"OK") if allowed else (b"400", b"this key is not known here")
        self._gate.send_multipart([version, request, status, text, b"", b""])
        if not allowed:
            self._refused("a client with an unknown key")


def check_address(address: Address, key: Key | None) -> None:
    """Refuse to be open to others than this machine without a key.

    Raises:
        InputError: It would be.
    """
    if not address.loopback and key is None:
        raise InputError(
            f"{address.host} can be reached by other machines, and whoever connects commands the engine: "
            "give --key FILE (bt-tasksim new-key makes one), or listen at 127.0.0.1"
        )
