"""Readers of demonstration logs: one file for each kind of log, and what opens any of them by its content."""

from __future__ import annotations

from pathlib import Path

from bt_tasksim.core import hdf5
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import parts
from bt_tasksim.demos_decomp.log import Log
from bt_tasksim.demos_decomp.readers.base import LogReader as LogReader


def open_log(path: str | Path) -> Log:
    """Read a log of any known kind; the kind announced last is asked first.

    Args:
        path: The file.

    Returns:
        The log, checked.

    Raises:
        InputError: The file is missing, empty, damaged or of no known kind, or its content is faulty.
    """
    path = Path(path)
    hdf5.check_file(path)
    known: dict[str, type[LogReader]] = dict(reversed(parts("log reader").items()))
    for kind in known.values():
        reader = kind()
        if reader.recognises(path):
            return reader.read(path)
    names = ", ".join(kind.title or name for name, kind in known.items())
    raise InputError(f"'{path}' is no log of a known kind ({names}); see docs/demonstrations.md")
