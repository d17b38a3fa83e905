"""Files that people exchange, read with bounds: whatever stands at a path, reading it costs little."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from bt_tasksim.core.errors import InputError

LARGEST = 1 << 20
"""Bytes of a file that people write by hand; the bundled ones have up to 6 kB."""


def read_bytes(
    path: str | os.PathLike[str], owner: str, largest: int = LARGEST, missing: str | None = None
) -> bytes:
    """The content of a file; a pipe or a device, which may go on for ever, is not waited for.

    Args:
        path: The file.
        owner: What it is, for errors, such as ``scene file 'a.yaml'``.
        largest: Bytes beyond which it is refused.
        missing: The sentence where there is no such file; None for the usual one.

    Raises:
        InputError: It cannot be opened, is no ordinary file, or too large.
    """
    try:
        handle = os.open(Path(path), os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise InputError(f"{owner} cannot be read: it is not an ordinary file")
            with open(handle, "rb", closefd=False) as file:
                content = file.read(largest + 1)
        finally:
            os.close(handle)
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        if missing is not None and isinstance(error, FileNotFoundError):
            raise InputError(missing) from None
        said = error.strerror if isinstance(error, OSError) else None
        raise InputError(f"{owner} cannot be read: {said or error}") from error
    if len(content) > largest:
        raise InputError(
            f"{owner} is larger than {largest / (1 << 20):.3g} MiB, which is the most it may have"
        )
    return content


def read_text(path: str | os.PathLike[str], owner: str, largest: int = LARGEST) -> str:
    """The text of a file.

    Args:
        path: The file.
        owner: What it is, for errors, such as ``scene file 'a.yaml'``.
        largest: Bytes beyond which it is refused.

    Raises:
        InputError: As for `read_bytes`, or it is not UTF-8, or holds a NUL.
    """
    content = read_bytes(path, owner, largest)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{owner} is not text in UTF-8: byte {error.start} is {content[error.start]:#04x}"
        ) from error
    if "\0" in text:
        raise InputError(f"{owner} is not text: it holds a NUL character")
    return text
