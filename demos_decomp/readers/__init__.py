"""Opens any log that a reader is known for, by its content.

A further kind of log is one more entry: ``register("name", recognises, read)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py

from bt_tasksim.errors import InputError
from demos_decomp.log import Log
from demos_decomp.log_file import opened, read_log
from demos_decomp.maniskill import is_maniskill, read_maniskill


@dataclass(frozen=True)
class Reader:
    """A kind of log.

    Attributes:
        name: What people call it.
        recognises: Whether a file is of this kind, by its content; must not raise for a file that is not.
        read: Reads it; raises `InputError` where its content is faulty.
    """

    name: str
    recognises: Callable[[Path], bool]
    read: Callable[[Path], Log]


_READERS: list[Reader] = []


def register(name: str, recognises: Callable[[Path], bool], read: Callable[[Path], Log]) -> None:
    """Adds a kind of log; the latest one registered is asked first."""
    _READERS.insert(0, Reader(name, recognises, read))


def readers() -> tuple[Reader, ...]:
    """The known kinds of logs, in the order in which they are asked."""
    return tuple(_READERS)


def open_log(path: str | Path) -> Log:
    """Reads a log of any known kind.

    Args:
        path: The file.

    Returns:
        The log, checked.

    Raises:
        InputError: The file is missing, empty, damaged or of no known kind, or its content is faulty.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"there is no file '{path}'; check the path")
    if path.is_dir():
        raise InputError(f"'{path}' is a folder; name the log file in it")
    if path.stat().st_size == 0:
        raise InputError(f"'{path}' is empty; record or copy it again")
    for reader in _READERS:
        if reader.recognises(path):
            return reader.read(path)
    known = ", ".join(reader.name for reader in _READERS)
    raise InputError(f"'{path}' is no log of a known kind ({known}); see docs/demonstrations.md")


def _is_own(path: Path) -> bool:
    if not h5py.is_hdf5(path):
        return False
    with opened(path) as file:
        return "format" in file.attrs or "demonstrations" in file


register("ManiSkill trajectory.h5", is_maniskill, read_maniskill)
register("bt-tasksim log", _is_own, read_log)
