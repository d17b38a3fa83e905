"""Where a robot's rosbridge is: ``ros:HOST:PORT``."""

from __future__ import annotations

from bt_tasksim.core.errors import InputError
from bt_tasksim.engines.remote.address import PREFIX as REMOTE
from bt_tasksim.engines.remote.address import Address, parse_remote

PREFIX = "ros:"
DEFAULT_PORT = 9090


def parse_ros(name: str) -> Address:
    """The address in a name such as ``ros:192.0.2.10:9090``.

    Raises:
        InputError: It is none.
    """
    try:
        return parse_remote(REMOTE + name.removeprefix(PREFIX))
    except InputError as error:
        raise InputError(f"{str(error).replace(REMOTE, PREFIX).replace('5599', str(DEFAULT_PORT))}") from None
