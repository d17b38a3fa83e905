"""A WebSocket client for small texts (RFC 6455), by the standard library: the watchdog loads no more."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import os
import socket
import struct

_MAGIC = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
LARGEST = 1 << 20
"""Bytes of a message that is read; longer ones are skipped."""
_TEXT, _CLOSE, _PING, _PONG = 1, 8, 9, 10


class WebSocket:
    """A connection; one thread may send while another one receives.

    Args:
        host: Where the server is.
        port: Its port.
        patience: Seconds for connecting and for sending.

    Raises:
        OSError: There is no server, or it speaks no WebSocket.
    """

    def __init__(self, host: str, port: int, patience: float = 1.0) -> None:
        self._socket = socket.create_connection((host, port), patience)
        self._data = bytearray()
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._shake_hands(host, port)
        except BaseException:
            self._socket.close()
            raise

    def _shake_hands(self, host: str, port: int) -> None:
        key = base64.b64encode(os.urandom(16))
        self._socket.sendall(
            f"GET / HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key.decode()}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        while b"\r\n\r\n" not in self._data:
            if len(self._data) > 1 << 14:
                raise OSError("the server speaks no WebSocket")
            self._data += self._read()
        head, _, self._data = self._data.partition(b"\r\n\r\n")
        accepted = base64.b64encode(hashlib.sha1(key + _MAGIC).digest())  # as the protocol says
        if not head.startswith(b"HTTP/1.1 101") or accepted not in head:
            raise OSError("the server speaks no WebSocket")

    def send(self, text: str) -> None:
        """Send a text.

        Raises:
            OSError: The connection is lost.
        """
        self._send(_TEXT, text.encode())

    def receive(self, timeout: float | None = None) -> str | None:
        """The next text; None where none has come within so many seconds.

        Raises:
            OSError: The connection is lost.
        """
        while True:
            try:
                self._socket.settimeout(timeout)
                kind, content = self._message()
            except TimeoutError:
                return None
            if kind == _TEXT:
                return content.decode("utf8", "replace")
            if kind == _PING:
                self._send(_PONG, content[:125])
            if kind == _CLOSE:
                raise OSError("the server has closed the connection")

    def close(self) -> None:
        """Disconnect; a thread that receives gets `OSError`."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _message(self) -> tuple[int, bytes]:
        """Kind and content of a whole message; fragments are put together."""
        whole, first = b"", 0
        while True:
            final, kind, content = self._frame()
            if kind >= _CLOSE:
                return kind, content
            first = first or kind
            if len(whole) <= LARGEST:
                whole += content
            if final:
                return (first, whole) if len(whole) <= LARGEST else (0, b"")

    def _frame(self) -> tuple[bool, int, bytes]:
        """A frame, once all of it is there: a timeout loses nothing."""
        need = 2
        while True:
            self._fill(need)
            head, length = self._data[0:2], self._data[1] & 0x7F
            if head[0] & 0x70 or head[1] & 0x80:
                raise OSError("the server sends frames that no server may send")
            at = 2
            if length == 126:
                self._fill(4)
                length, at = struct.unpack("!H", self._data[2:4])[0], 4
            elif length == 127:
                self._fill(10)
                length, at = struct.unpack("!Q", self._data[2:10])[0], 10
            if length > 1 << 26:
                raise OSError(f"a frame of {length} bytes")
            self._fill(at + length)
            content = bytes(self._data[at : at + length])
            del self._data[: at + length]
            return bool(head[0] & 0x80), head[0] & 0x0F, content

    def _fill(self, n: int) -> None:
        while len(self._data) < n:
            self._data += self._read()

    def _read(self) -> bytes:
        piece = self._socket.recv(1 << 16)
        if not piece:
            raise OSError("the server has closed the connection")
        return piece

    def _send(self, kind: int, content: bytes) -> None:
        n = len(content)
        if n < 126:
            head = struct.pack("!BB", 0x80 | kind, 0x80 | n)
        elif n < 1 << 16:
            head = struct.pack("!BBH", 0x80 | kind, 0x80 | 126, n)
        else:
            head = struct.pack("!BBQ", 0x80 | kind, 0x80 | 127, n)
        mask = os.urandom(4)
        repeated = (mask * (n // 4 + 1))[:n]
        masked = int.from_bytes(content, "big") ^ int.from_bytes(repeated, "big")
        self._socket.sendall(head + mask + masked.to_bytes(n, "big"))
