"""A hold channel over TCP: one JSON line tells the other side to hold. Imports the standard library alone."""

from __future__ import annotations

import json
import socket


class SocketHold:
    """Connects to a robot's own process and sends ``{"hold": why}`` and a line feed.

    Args:
        host: Where it listens.
        port: Its port.
        patience: Seconds for connecting and for sending.
    """

    def __init__(self, host: str, port: int, patience: float = 1.0) -> None:
        self._address = (host, port)
        self._patience = patience
        self._socket: socket.socket | None = None

    def open(self) -> None:
        """See `HoldChannel.open`."""
        self.close()
        self._socket = socket.create_connection(self._address, self._patience)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def hold(self, why: str) -> None:
        """See `HoldChannel.hold`; connects again where the connection was lost."""
        line = json.dumps({"hold": why}).encode() + b"\n"
        try:
            if self._socket is None:
                raise OSError("not connected")
            self._socket.sendall(line)
        except OSError:
            self.open()
            assert self._socket is not None
            self._socket.sendall(line)

    def close(self) -> None:
        """See `HoldChannel.close`."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
