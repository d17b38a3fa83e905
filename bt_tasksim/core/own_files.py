"""Files that a user's Python names by a relative path: beside it first, else in the working folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from bt_tasksim.core.plain import shown

_FOLDER: ContextVar[Path | None] = ContextVar("folder of the Python file whose code runs", default=None)


@contextmanager
def code_of(file: Path) -> Iterator[None]:
    """While the block runs, code of this Python file does."""
    token = _FOLDER.set(file.resolve().parent)
    try:
        yield
    finally:
        _FOLDER.reset(token)


def beside_code(name: str) -> str:
    """The absolute path of a file that lies beside the code that names it; else the name as it is."""
    folder = _FOLDER.get()
    return str(folder / name) if folder is not None and (folder / name).is_file() else name


def own_file(name: str) -> Path:
    """Absolute path of a file that somebody's code names; it may not exist."""
    return Path(beside_code(name)).resolve()


def not_there(what: str, name: str) -> str:
    """That there is no such file, and where it was looked for, in one sentence."""
    return f"no {what} '{shown(name, 200)}'" + ("" if Path(name).is_absolute() else f" in {looked_in()}")


def looked_in() -> str:
    """Where such files are looked up, in words."""
    folder, here = _FOLDER.get(), Path.cwd()
    return str(here) if folder in (None, here) else f"{folder} and {here}"
