"""HDF5 files that may come from anybody, read into plain arrays.

The reading itself happens in a process of its own (`bt_tasksim.core.hdf5_process`) with limits on time,
memory and open files; it is kept for the next file, and replaced when a file has broken it.
"""

from __future__ import annotations

import contextlib
import functools
import json
import math
import os
import re
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bt_tasksim.core import child
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.hdf5_process import FRAME, MOST_ATTRIBUTE

MOST_BYTES = 512 << 20
"""What the data sets of one file may take together."""
SECONDS = 6.0
"""Processor time in seconds that reading a file may take, besides `RATE`."""
RATE = 50e6
"""Bytes of a file for which it may take a second more."""
PATIENCE = 10.0
"""How much longer it may take by the clock: other processes may leave it little of the machine."""
STARTING = 60.0
"""Seconds within which the process has to be there."""
MAGIC = b"\x89HDF\r\n\x1a\n"

Attribute = str | list[str] | NDArray[Any]
"""A text, several texts, or numbers; a single number has the shape ``()``."""

_TYPE = re.compile(r"[<>|=]?(?:[biuf][1248]|S[0-9]{1,9})\Z")


@dataclass(frozen=True)
class Node:
    """A group of an HDF5 file.

    Attributes:
        path: Its path in the file, without a slash in front; empty for the file itself.
        attributes: Its attributes.
        groups: Groups in it, by name.
        data: Data sets in it, by name. Texts of any length are objects, namely bytes.
        skipped: Names of what was not asked for, or is neither numbers nor text.
        data_attributes: Attributes of the data sets, by name.
    """

    path: str = ""
    attributes: dict[str, Attribute] = field(default_factory=dict)
    groups: dict[str, Node] = field(default_factory=dict)
    data: dict[str, NDArray[Any]] = field(default_factory=dict)
    skipped: set[str] = field(default_factory=set)
    data_attributes: dict[str, dict[str, Attribute]] = field(default_factory=dict)

    def group(self, path: str) -> Node | None:
        """The group at a path below this one, if there is one."""
        node: Node | None = self
        for name in path.split("/"):
            node = None if node is None else node.groups.get(name)
        return node

    def dataset(self, path: str) -> NDArray[Any] | None:
        """The data set at a path below this group, if there is one."""
        above, _, name = path.rpartition("/")
        node = self.group(above) if above else self
        return None if node is None else node.data.get(name)

    def names(self) -> list[str]:
        """Names of all members, sorted."""
        return sorted({*self.groups, *self.data, *self.skipped})

    def walk(self) -> Iterator[tuple[str, NDArray[Any]]]:
        """Paths below this group, and values, of all data sets."""
        yield from self.data.items()
        for name, node in self.groups.items():
            for path, values in node.walk():
                yield f"{name}/{path}", values


def is_hdf5(path: Path) -> bool:
    """Whether a file begins as HDF5 files do; one with a user block in front counts, too."""
    try:
        with open(path, "rb") as file:
            at = 0
            while head := file.read(len(MAGIC)):
                if head == MAGIC:
                    return True
                at = max(512, 2 * at)
                file.seek(at)
    except OSError:
        return False
    return False


def read(path: Path, wanted: Sequence[str] = ("**",), seconds: float = SECONDS) -> Node:
    """Reads an HDF5 file.

    Args:
        path: The file.
        wanted: Patterns of the data sets to read, such as ``traj_*/env_states/**``; names and attributes of
            groups on the way are read in any case.
        seconds: Processor time that it may take.

    Returns:
        The file's root.

    Raises:
        InputError: The file is missing, empty, damaged, too large or takes too long, or something in it is
            stored outside of it.
        MachineError: The process that reads does not start.
    """
    check_file(path)
    if not is_hdf5(path):
        raise InputError(f"'{path}' is not an HDF5 file; see docs/demonstrations.md for the log format")
    size = min(path.stat().st_size, MOST_BYTES)  # a file may have holes
    return _reader(os.getpid()).read(path, wanted, seconds + size / RATE)


def check_file(path: Path) -> None:
    """Check that there is a file with something in it.

    Raises:
        InputError: There is none, it is a folder or a device, or it is empty.
    """
    try:
        if not path.exists():
            raise InputError(f"there is no file '{path}'; check the path")
        if path.is_dir():
            raise InputError(f"'{path}' is a folder; name the log file in it")
        if not path.is_file():
            raise InputError(f"'{path}' is a device or a pipe; name a file")
        if path.stat().st_size == 0:
            raise InputError(f"'{path}' is empty; record or copy it again")
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror or error}") from error


class Reader:
    """The process that reads, started when there is something to read; threads wait for each other.

    Args:
        most_bytes: What the data sets of one file may take together.
    """

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self.most_bytes = most_bytes
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def read(self, path: Path, wanted: Sequence[str], seconds: float) -> Node:
        """See `read`."""
        with self._lock:
            try:
                process = self._running()
                return self._read(process, path, wanted, seconds)
            except InputError:
                raise
            except BaseException:  # an interrupt, too: the rest of the answer is of no use
                self.close()
                raise

    def close(self) -> None:
        """End the process; the next file starts another one."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for pipe in (self._process.stdin, self._process.stdout):
                assert pipe is not None
                pipe.close()
            self._process = None

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is not None and self._process.poll() is None:
            return self._process
        self.close()
        self._process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("hdf5_process.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            bufsize=0,
            process_group=0,
            env={
                **os.environ,
                **child.ONE_THREAD,
                **child.VARIABLES,
                "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
                "HDF5_USE_FILE_LOCKING": "FALSE",
                "HDF5_PLUGIN_PATH": os.devnull,
            },
        )
        pipe = _Pipe(self._process, time.monotonic() + STARTING)
        try:
            pipe.frame(0)
        except (EOFError, TimeoutError) as error:
            raise MachineError(
                "the process that reads HDF5 files does not start; is the package h5py installed?"
            ) from error
        return self._process

    def _read(
        self, process: subprocess.Popen[bytes], path: Path, wanted: Sequence[str], seconds: float
    ) -> Node:
        request = {
            "file": os.path.abspath(path),
            "wanted": list(wanted),
            "most_bytes": self.most_bytes,
            "seconds": seconds,
            "patience": PATIENCE,
        }
        assert process.stdin is not None
        root = Node()
        pipe = _Pipe(process, time.monotonic() + PATIENCE * seconds)
        try:
            process.stdin.write(json.dumps(request).encode() + b"\n")
            left = self.most_bytes
            while True:
                header, content = pipe.frame(left)
                left -= len(content)
                if header["kind"] == "end":
                    return root
                if header["kind"] == "error":
                    raise _refusal(path, header)
                _add(root, header, content)
        except TimeoutError:
            self.close()
            raise _too_long(path, seconds) from None
        except (EOFError, OSError):
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(1.0)
            late = process.returncode == -signal.SIGPROF
            self.close()
            if late:
                raise _too_long(path, seconds) from None
            raise InputError(
                f"'{path}' is damaged: the HDF5 library breaks down over it; record or copy it again"
            ) from None


class _Pipe:
    """Frames from the process, until a time of `time.monotonic`."""

    def __init__(self, process: subprocess.Popen[bytes], until: float) -> None:
        assert process.stdout is not None
        self._file = process.stdout.fileno()
        self._until = until
        self._poll = select.poll()
        self._poll.register(self._file, select.POLLIN)

    def frame(self, most_bytes: int) -> tuple[dict[str, Any], bytearray]:
        """Header and content.

        Raises:
            EOFError: The process has ended, or has lost its way.
            TimeoutError: It takes too long.
        """
        about, size = FRAME.unpack(self._bytes(FRAME.size))
        if about > 64 * MOST_ATTRIBUTE or size > most_bytes:
            raise EOFError
        try:
            header = json.loads(self._bytes(about))
        except ValueError:
            raise EOFError from None
        return header, self._bytes(size)

    def _bytes(self, count: int) -> bytearray:
        content = bytearray(count)
        left = memoryview(content)
        while left:
            wait = self._until - time.monotonic()
            if wait <= 0.0 or not self._poll.poll(1000.0 * wait):
                raise TimeoutError
            got = os.readv(self._file, [left])
            if not got:
                raise EOFError
            left = left[got:]
        return content


@functools.lru_cache(maxsize=1)
def _reader(process: int) -> Reader:
    """This process's reader; a forked process gets one of its own."""
    return Reader()


def _add(root: Node, header: Mapping[str, Any], content: bytearray) -> None:
    """Put a frame where it belongs."""
    above, _, name = header["path"].rpartition("/")
    parent = root.group(above) if above else root
    if parent is None:
        raise EOFError
    match header["kind"]:
        case "group" if not header["path"]:
            root.attributes.update(_attributes(header))
        case "group":
            parent.groups[name] = Node(header["path"], _attributes(header))
        case "skipped":
            parent.skipped.add(name)
        case "data":
            parent.data[name] = _values(header["type"], tuple(header["shape"]), content)
            parent.data_attributes[name] = _attributes(header)
        case _:
            raise EOFError


def _values(kind: str, shape: tuple[int, ...], content: bytearray) -> NDArray[Any]:
    count = math.prod(shape)
    if kind == "text":
        lengths = np.frombuffer(content, "<i8", count)
        ends = 8 * count + np.cumsum(lengths)
        texts = np.empty(count, dtype=object)
        for i, (length, end) in enumerate(zip(lengths.tolist(), ends.tolist(), strict=True)):
            texts[i] = bytes(content[end - length : end])
        return texts.reshape(shape)
    if not _TYPE.match(kind) or count * np.dtype(kind).itemsize != len(content):
        raise EOFError
    return np.frombuffer(content, kind).reshape(shape) if content else np.zeros(shape, kind)


def _attributes(header: Mapping[str, Any]) -> dict[str, Attribute]:
    return {name: _attribute(value) for name, value in header["attributes"].items()}


def _attribute(value: Any) -> Attribute:
    if isinstance(value, dict):
        if not _TYPE.match(value["type"]):
            raise EOFError
        return np.array(value["values"], value["type"]).reshape(value["shape"])
    assert isinstance(value, str | list)
    return value


_REFUSALS = {
    "link": "'{file}': {path} points outside itself; copy the data into the file",
    "size": "'{file}': {path} holds {about} values, too many to read; split the log",
    "name": "'{file}' has something named {about} in its group '{path}'; use short names that can be printed",
    "nodes": "'{file}' holds more than {about} groups, data sets and attributes; split the log",
    "deep": "'{file}': {path} lies in more than {about} groups within each other; put it higher up",
    "memory": "'{file}' takes too much memory to read; split the log",
    "damaged": "'{file}' is cut off or damaged ({about}); record or copy it again",
}


def _refusal(path: Path, header: Mapping[str, Any]) -> InputError:
    said = {name: _printable(str(header.get(name, ""))) for name in ("path", "about")}
    return InputError(_REFUSALS[header["code"]].format(file=path, **said))


def _too_long(path: Path, seconds: float) -> InputError:
    return InputError(
        f"'{path}' is damaged or holds too much: reading it takes more than {seconds:.0f} s; record or "
        "copy it again, or split it"
    )


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)[:400]
