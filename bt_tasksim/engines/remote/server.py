"""The process that serves an engine: one socket, one loop, one message after the other.

Two small threads work while the engine does: one says who may connect
(`bt_tasksim.engines.remote.authentication`), one looks after the memory that unfinished messages take up.
"""

from __future__ import annotations

import threading
import time
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import zmq
from zmq.utils.monitor import recv_monitor_message

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.engines.remote.address import Address
from bt_tasksim.engines.remote.authentication import KeyAuthenticator
from bt_tasksim.engines.remote.keys import Key
from bt_tasksim.engines.remote.schema import Frame
from bt_tasksim.engines.remote.session import ServedSession
from bt_tasksim.engines.remote.sockets import end, prepare, receive, send

_WAKE = 200
"""Milliseconds after which the loop looks whether it should stop, and after which the memory is looked at."""
_PROBES = (0.0, 0.02, 0.1)
"""Seconds before each look at whether an owner is still there: a closed connection takes a moment to show."""
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
        session: ServedSession,
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
        self._using = threading.Lock()  # whoever has it may use the sockets
        self._open()

    def _open(self) -> None:
        """Listen, without any client yet."""
        context = zmq.Context()
        self._socket = context.socket(zmq.ROUTER)
        self._monitor = self._socket.get_monitor_socket(sum(_FAILED))
        self._end = weakref.finalize(self, end, context, self._socket, self._monitor)
        address = self.address
        try:
            if self.key is not None:
                KeyAuthenticator(context, self.key, self._refused)
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
        for socket in (self._socket, self._monitor):
            self._poller.register(socket, zmq.POLLIN)
        self.session.watch.renew()

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
        with self._watched():
            while not stopped():
                with self._using:
                    client, frames = self._next()
                if frames:
                    self._send(client, self.session.answer(client, frames, self._there))

    def close(self) -> None:
        """Let go of the port and of every client."""
        self._end()

    def _next(self) -> tuple[bytes, Sequence[Frame]]:
        """A message and who sent it; no frames where none has come for a while."""
        if not self._end.alive:
            self._open()
        self._watch_memory()
        ready = dict(self._poller.poll(_WAKE))
        if self._monitor in ready:
            self._read_monitor()
        if self._socket not in ready:
            return b"", []
        client, *frames = receive(self._socket, self._pictures)
        return bytes(client), frames

    def _send(self, client: bytes, frames: Sequence[Frame]) -> bool:
        """Send to a client that is still there and listens; says whether it could be."""
        try:
            with self._using:
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

    @contextmanager
    def _watched(self) -> Iterator[None]:
        """Have the memory looked at while the engine works, too."""
        over = threading.Event()

        def watch() -> None:
            while not over.wait(_WAKE / 1000.0):
                with self._using:
                    self._watch_memory()

        thread = threading.Thread(target=watch, name="memory watch", daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def _watch_memory(self) -> None:
        """Cut every connection where unfinished messages fill the memory; the loop listens anew."""
        now = time.monotonic()
        if now < self._look:
            return
        self._look = now + _WAKE / 1000.0
        if self._end.alive and self.session.watch.strange() > self.memory:
            self._refused(f"messages without end, {self.memory >> 20} MiB of them: all connections were cut")
            self.close()

    def _read_monitor(self) -> None:
        recv_monitor_message(self._monitor)
        self._refused(
            "a connection whose other side does not speak the protocol"
            + (" or has not the right key" if self.key else ", or wants encryption where there is none")
        )


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
