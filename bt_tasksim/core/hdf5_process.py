"""The process that reads HDF5 files for `bt_tasksim.core.hdf5`.

libhdf5 trusts what it reads: one flipped bit makes it loop for ever, ask for terabytes or crash, and links in
a file may lead to other files. So it runs here, where a time limit, a memory limit and a limit on open files
bind it: once it has opened the file that it was told to, the kernel lets it open no other.

It reads requests from standard input, one line of JSON each, and answers on standard output with frames: two
unsigned 64-bit lengths, then a JSON header and raw bytes of these lengths. The last frame of an answer is of
kind ``end`` or ``error``. It is started as a script and imports nothing of this project.
"""

from __future__ import annotations

import codecs
import fnmatch
import json
import math
import os
import re
import resource
import signal
import struct
import sys
from collections.abc import Iterator
from typing import Any

import h5py
import numpy as np

FRAME = struct.Struct("<QQ")
MOST_MEMORY = 2 << 30
"""Bytes of address space that this process may take."""
MOST_NODES = 100_000
"""Groups, data sets and attributes that a file may have, each counted once for each name that it has."""
DEEPEST = 32
"""Groups within groups."""
MOST_NAME = 256
"""Characters of a name."""
MOST_ATTRIBUTE = 1 << 20
"""Bytes of an attribute."""

_NUMBER = re.compile(r"[<>|=]?[biuf][1248]\Z")


class Refused(Exception):  # noqa: N818  # an answer, not a fault of this program
    """The file is not read: a code, the path within the file, and a number or a text about it."""

    def __init__(self, code: str, path: str = "", about: str | int = "") -> None:
        super().__init__(code)
        self.header = {"kind": "error", "code": code, "path": path, "about": about}


def frames(
    file: h5py.File, wanted: list[str], most_bytes: int
) -> Iterator[tuple[dict[str, Any], bytes | memoryview]]:
    """What a file holds, parents first.

    Args:
        file: The open file.
        wanted: Patterns of paths (`fnmatch`, without the first slash) of the data sets to read.
        most_bytes: What all of them may take together.

    Yields:
        Headers of kind ``group``, ``data`` and ``skipped``, and the values of the data.

    Raises:
        Refused: The file is too large, too deep, or leads outside of itself.
    """
    counted, taken = 0, 0
    stack: list[tuple[str, Any, int]] = [("", file, 0)]
    while stack:
        path, group, depth = stack.pop()
        attributes = _attributes(group, path)
        counted += 1 + len(attributes)
        yield {"kind": "group", "path": path, "attributes": attributes}, b""
        if depth > 0 and not _may_lead_to(path, wanted):
            continue
        for name in group:
            counted += 1
            if counted > MOST_NODES:
                raise Refused("nodes", path, MOST_NODES)
            if not (name.isprintable() and len(name) < MOST_NAME):
                raise Refused("name", path, ascii(name)[:60])
            inside = f"{path}/{name}".lstrip("/")
            link = group.get(name, getlink=True)
            if not isinstance(link, h5py.HardLink):
                raise Refused("link", inside)
            item = group[name]
            if isinstance(item, h5py.Group):
                if depth == DEEPEST:
                    raise Refused("deep", inside, DEEPEST)
                stack.append((inside, item, depth + 1))
            elif not isinstance(item, h5py.Dataset) or not _is_wanted(inside, wanted):
                yield {"kind": "skipped", "path": inside}, b""
            else:
                header, content = _data(item, inside, most_bytes - taken)
                taken += len(content)
                yield header | {"attributes": _attributes(item, inside)}, content


def _may_lead_to(path: str, wanted: list[str]) -> bool:
    """Whether a group is, or holds, something that is wanted."""
    parts = path.split("/")
    for pattern in wanted:
        pieces = pattern.split("/")
        if pieces[-1] == "**":
            pieces = pieces[:-1] + ["*"] * max(len(parts) - len(pieces) + 1, 0)
        if all(fnmatch.fnmatchcase(a, b) for a, b in zip(parts, pieces, strict=False)):
            return True
    return False


def _is_wanted(path: str, wanted: list[str]) -> bool:
    parts = path.split("/")
    for pattern in wanted:
        pieces = pattern.split("/")
        if pieces[-1] == "**" and len(parts) >= len(pieces):
            pieces = pieces[:-1] + ["*"] * (len(parts) - len(pieces) + 1)
        if len(parts) == len(pieces) and all(map(fnmatch.fnmatchcase, parts, pieces)):
            return True
    return False


def _data(item: h5py.Dataset, path: str, most_bytes: int) -> tuple[dict[str, Any], bytes | memoryview]:
    if item.is_virtual or item.external:
        raise Refused("link", path)
    if item.shape is None:
        return {"kind": "skipped", "path": path}, b""
    if item.size * max(item.dtype.itemsize, 1) > most_bytes:
        raise Refused("size", path, int(item.size))
    if h5py.check_string_dtype(item.dtype) is not None and item.dtype.kind == "O":
        texts = [_bytes(text) for text in np.asarray(item[()], dtype=object).ravel().tolist()]
        if sum(map(len, texts)) + 8 * len(texts) > most_bytes:
            raise Refused("size", path, int(item.size))
        lengths = np.array([len(text) for text in texts], "<i8").tobytes()
        return {"kind": "data", "path": path, "type": "text", "shape": item.shape}, lengths + b"".join(texts)
    if not (_NUMBER.match(item.dtype.str) or item.dtype.kind == "S"):
        return {"kind": "skipped", "path": path}, b""
    values = np.ascontiguousarray(item[()])
    content = values.reshape(-1).view(np.uint8).data if values.nbytes else b""
    return {"kind": "data", "path": path, "type": values.dtype.str, "shape": item.shape}, content


def _attributes(item: Any, path: str) -> dict[str, Any]:
    """Attributes as text, as several texts, or as numbers in a row with shape and type; no others."""
    found: dict[str, Any] = {}
    for name in item.attrs:
        if not (name.isprintable() and len(name) < MOST_NAME):
            raise Refused("name", path, ascii(name)[:60])
        about = item.attrs.get_id(name)
        if about.shape is None or about.dtype.kind not in "biufSO":
            continue
        count = math.prod(about.shape)
        if about.dtype.itemsize * count > MOST_ATTRIBUTE:
            raise Refused("size", f"{path} attribute {name}", count)
        if about.dtype.kind == "O" and h5py.check_string_dtype(about.dtype) is None:
            continue
        value = item.attrs[name]
        if isinstance(value, str | bytes):
            found[name] = _text(value)
            continue
        array = np.asarray(value)
        if array.dtype.kind in "OSU":
            found[name] = [_text(v) for v in array.ravel().tolist()]
        elif _NUMBER.match(array.dtype.str):
            found[name] = {
                "type": array.dtype.str,
                "shape": array.shape,
                "values": array.ravel().tolist(),
            }
    return found


def _bytes(text: Any) -> bytes:
    return text if isinstance(text, bytes) else str(text).encode("utf-8", "surrogateescape")


def _text(text: str | bytes) -> str:
    return _bytes(text).decode("utf-8", "replace")


def answer(request: dict[str, Any], out: int) -> None:
    """Read one file and write its frames."""
    try:
        with h5py.File(request["file"], "r") as file:
            for header, content in frames(file, request["wanted"], int(request["most_bytes"])):
                _write(out, header, content)
    except Refused as refused:
        _write(out, refused.header, b"")
    except MemoryError:
        _write(out, {"kind": "error", "code": "memory", "path": "", "about": ""}, b"")
    except Exception as error:  # whatever h5py makes of a damaged file
        said = " ".join(str(error).split())[:300]
        _write(
            out, {"kind": "error", "code": "damaged", "path": "", "about": said or type(error).__name__}, b""
        )
    else:
        _write(out, {"kind": "end"}, b"")


def _write(out: int, header: dict[str, Any], content: bytes | memoryview) -> None:
    text = json.dumps(header).encode()
    for part in (FRAME.pack(len(text), len(content)) + text, content):
        left = memoryview(part)
        while left:
            left = left[os.write(out, left) :]


def main() -> int:
    """Answer requests until there are no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's business
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for encoding in ("ascii", "latin-1", "unicode_escape"):
        codecs.lookup(encoding)
    with h5py.File.in_memory() as file:  # what h5py loads on first use needs files
        file["a/b"] = np.zeros(3)
        file["a/t"] = np.array([b"text"], dtype=h5py.string_dtype())
        file["a/s"] = np.array([b"text"])
        file["a"].attrs.update({"text": "text", "texts": [b"a"], "numbers": [1.0]})
        list(frames(file, ["**"], 1 << 10))
    out = os.dup(1)
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)  # libraries may print
    os.close(null)
    resource.setrlimit(resource.RLIMIT_NOFILE, (out + 2, out + 2))  # one more file, which is the one to read
    _write(out, {"kind": "end"}, b"")
    for line in sys.stdin.buffer:
        request = json.loads(line)
        signal.setitimer(signal.ITIMER_PROF, request["seconds"])  # of processor time; it ends this process
        signal.alarm(int(request["patience"] * request["seconds"]) + 2)  # should the parent be gone
        answer(request, out)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.alarm(0)
    return 0


if __name__ == "__main__":
    sys.exit(main())
