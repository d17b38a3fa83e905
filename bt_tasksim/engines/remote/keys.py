"""Key files for engines that are reached over a network (CURVE: encrypted, both sides known to each other).

A pair of files is made at once: one for the server, one for its clients. Each holds its own secret key and
the public key of the other side; a server lets nobody in but the holder of its clients' file.
"""

from __future__ import annotations

import json
import os
import stat
from dataclasses import dataclass
from pathlib import Path

import zmq
from zmq.utils import z85

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.files import whole_file

SERVER, CLIENT = "server", "client"
_TITLE = "bt-tasksim key for"
_ENTRIES = {_TITLE, "public", "secret", "peer"}
_MOST = 4096


@dataclass(frozen=True)
class Key:
    """One side's keys, in ZeroMQ's text form (Z85): its own pair, and the public key of the other side."""

    public: bytes
    secret: bytes
    peer: bytes

    def __repr__(self) -> str:
        return f"Key(public={self.public!r})"


def make_keys(path: str | Path) -> tuple[Path, Path]:
    """Write a new pair of key files, which nobody else on this machine can read.

    Args:
        path: The server's file; the clients' one goes beside it, ``engine.key`` with ``engine.client.key``.

    Returns:
        Paths of the server's and of the clients' file.

    Raises:
        InputError: The path names no file, one of the two exists, or their folder does not.
        MachineError: The disk is full or not writable.
    """
    server = Path(path)
    if not server.name:
        raise InputError(f"'{path}' names no file for a key: choose one, such as engine.key")
    client = server.with_name(f"{server.stem}.client{server.suffix}")
    for file in (server, client):
        if file.exists():
            raise InputError(f"'{file}' exists and may be a key in use: choose another name")
    ours, theirs = zmq.curve_keypair(), zmq.curve_keypair()
    _write(server, SERVER, Key(*ours, theirs[0]))
    try:
        _write(client, CLIENT, Key(*theirs, ours[0]))
    except BaseException:
        server.unlink(missing_ok=True)  # one without the other opens nothing
        raise
    return server, client


def load_key(path: str | Path, side: str) -> Key:
    """One side's key file.

    Args:
        path: The file.
        side: `SERVER` or `CLIENT`.

    Raises:
        InputError: There is no such file, others may read it, it is the other side's, or it holds no key.
    """
    file = Path(path)
    try:
        mode = file.stat().st_mode
        if not stat.S_ISREG(mode):
            raise InputError(f"'{file}' is no key file: make one with 'bt-tasksim new-key FILE'")
        if mode & (stat.S_IRWXG | stat.S_IRWXO):
            raise InputError(f"key file '{file}' can be read by others on this machine: chmod 600 '{file}'")
        with open(file, "rb") as opened:
            content = json.loads(opened.read(_MOST))
        if not isinstance(content, dict) or set(content) != _ENTRIES:
            raise ValueError
        key = Key(*(str(content[name]).encode() for name in ("public", "secret", "peer")))
        if zmq.curve_public(key.secret) != key.public or len(z85.decode(key.peer)) != 32:
            raise ValueError
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"key file '{file}' cannot be read: {error.strerror or error}") from None
    except (ValueError, RecursionError, zmq.ZMQError):
        raise InputError(
            f"'{file}' does not hold a key: make a pair with 'bt-tasksim new-key FILE'"
        ) from None
    if content[_TITLE] != side:
        raise InputError(
            f"'{file}' is the {content[_TITLE]}'s key, and this is the {side}: take the pair's other file"
        )
    return key


def _write(path: Path, side: str, key: Key) -> None:
    parts = {"public": key.public, "secret": key.secret, "peer": key.peer}
    content = {_TITLE: side, **{name: value.decode() for name, value in parts.items()}}
    with whole_file(path) as unfinished:
        handle = os.open(unfinished, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with open(handle, "w", encoding="ascii") as opened:
            opened.write(json.dumps(content, indent=2) + "\n")
