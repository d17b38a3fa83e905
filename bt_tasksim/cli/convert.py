"""People's Python files of version 0.1, whose imports name modules that have moved."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from bt_tasksim.core.bounded_text import read_bytes
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.files import write_text
from bt_tasksim.core.former import convert

LARGEST = 2_000_000
"""Bytes of a Python file."""


def convert_files(files: Sequence[Path], check: bool = False) -> tuple[list[str], int]:
    """Convert the imports of Python files, in place.

    Args:
        files: The files.
        check: Change nothing, only say what would be.

    Returns:
        A line for each change, and for each name that nothing defines any more; and the count of changes.

    Raises:
        InputError: A file cannot be read or is not Python; then none is changed.
    """
    found = [(file, convert(_text(file), str(file))) for file in files]
    lines, changes = [], 0
    for file, converted in found:
        lines += [f"{file}, {change}" for change in converted.changes]
        lines += converted.unknown
        changes += len(converted.changes)
        if converted.changes and not check:
            write_text(file, converted.text)
    return lines or ["nothing to convert"], changes


def _text(file: Path) -> str:
    try:
        return read_bytes(file, f"'{file}'", LARGEST).decode()
    except UnicodeDecodeError as error:
        raise InputError(f"'{file}' is not UTF-8") from error
