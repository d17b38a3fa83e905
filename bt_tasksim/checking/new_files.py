"""What all of ``bt-tasksim new`` share: every file is written or none is, and never over another."""

from __future__ import annotations

import contextlib
import importlib.util
import re
from collections.abc import Mapping
from pathlib import Path

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.files import write_texts
from bt_tasksim.core.resources import asset

NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
"""Lower-case words joined by underscores."""


def check_word(name: str, what: str, such_as: str) -> None:
    """Refuse a name that is not lower-case words joined by underscores.

    Raises:
        InputError: It is not.
    """
    if not NAME.fullmatch(name):
        raise InputError(
            f"the name of {what} should be lower-case words joined by '_', such as {such_as}: found '{name}'"
        )


def write_new(folder: Path, texts: Mapping[Path, str]) -> None:
    """Write files into a folder, which is made where there is none.

    Args:
        folder: The folder.
        texts: Their texts, by path in it.

    Raises:
        InputError: A file is there already, or the folder is a file; then nothing is written.
        MachineError: The disk is full or not writable; then nothing is written.
    """
    check_new(folder, texts)
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_texts({str(path): text for path, text in texts.items()})
    except BaseException as error:
        for path in made:
            with contextlib.suppress(OSError):
                path.rmdir()
        if isinstance(error, OSError):
            raise MachineError(f"cannot make the folder '{folder}': {error.strerror or error}") from error
        raise


def check_new(folder: Path, files: Mapping[Path, object]) -> None:
    """Refuse to write over anything.

    Raises:
        InputError: A file is there already, or the folder is a file.
    """
    above = next(path for path in (folder, *folder.parents) if path.exists())
    if not above.is_dir():
        raise InputError(f"'{above}' is a file: name another folder with --out")
    for path in files:
        if path.exists() or path.is_symlink():
            raise InputError(f"'{path}' is there already: remove it, or choose another name or --out")


def check_free(name: str) -> None:
    """Refuse a file's name by which another module is imported: it would be met instead of that one.

    Raises:
        InputError: There is such a module, Python's own and ours among them.
    """
    try:
        found = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        found = None
    if found is not None:
        raise InputError(f"a Python module '{name}' is installed already: choose another name")


def filled(template: tuple[str, ...], values: Mapping[str, str]) -> str:
    """A template of the assets, with values put for ``@key@``.

    Args:
        template: Its folders and name.
        values: Texts by key.
    """
    text = asset(*template).read_text(encoding="utf-8")
    for key, value in values.items():
        text = text.replace(f"@{key}@", value)
    return text


def named(name: str) -> dict[str, str]:
    """What every template says of its name."""
    words = name.replace("_", " ")
    return {"name": name, "words": words, "Words": words[:1].upper() + words[1:]}
