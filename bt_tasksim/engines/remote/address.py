"""Where a served engine is: ``HOST:PORT``, and whether that is this machine only."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass

from bt_tasksim.core.errors import InputError

PREFIX = "remote:"
LOOPBACK = "127.0.0.1"
DEFAULT_PORT = 5599


@dataclass(frozen=True)
class Address:
    """A host and a TCP port.

    Attributes:
        host: An IP address without brackets, or a host name.
        port: 1 to 65535; 0 where a server may choose.
    """

    host: str
    port: int

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    @property
    def loopback(self) -> bool:
        """It is reached from this machine only."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    @property
    def url(self) -> str:
        """As ZeroMQ takes it."""
        host = LOOPBACK if self.host == "localhost" else self.host
        return f"tcp://{Address(host, self.port)}"


def parse_remote(name: str) -> Address:
    """The address in an engine's name, such as ``remote:127.0.0.1:5599`` or ``remote:[::1]:5599``.

    Raises:
        InputError: It is none.
    """
    host, _, port = name.removeprefix(PREFIX).rpartition(":")
    if host.startswith("[") and host.endswith("]"):
        host = host[1:-1]
        _ip(host, name)
    elif not host or not all(c.isascii() and (c.isalnum() or c in "-._") for c in host):
        raise InputError(f"'{name}' should read {PREFIX}HOST:PORT, such as {PREFIX}{LOOPBACK}:{DEFAULT_PORT}")
    if not (port.isascii() and port.isdigit() and 1 <= int(port) <= 65535):
        raise InputError(f"'{name}' should end with a port from 1 to 65535, found '{port}'")
    return Address(host, int(port))


def listening(host: str, port: int) -> Address:
    """The address that a server listens at.

    Args:
        host: An IP address of this machine; ``0.0.0.0`` or ``::`` for all of them.
        port: A port; 0 for a free one.

    Raises:
        InputError: It is none.
    """
    if not 0 <= port <= 65535:
        raise InputError(f"a port is a number from 0 to 65535, found {port}")
    if host == "localhost":
        host = LOOPBACK
    _ip(host, host)
    return Address(host, port)


def _ip(host: str, shown: str) -> None:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        raise InputError(f"'{shown}' does not name an IP address, such as {LOOPBACK}") from None
