"""What is given by a registered name, or as the path of a data file: robots, fixtures."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.own_files import own_file
from bt_tasksim.core.plain import shown
from bt_tasksim.core.registry import part
from bt_tasksim.core.resources import FURNITURE, is_file

T = TypeVar("T")


def named_data(kind: str, name: str, value: type[T]) -> Path | T:
    """The data file, or the value itself, that a name stands for.

    Args:
        kind: The kind of part, which is also how a file of it is called: ``robot``, ``fixture``.
        name: A registered name, or a path.
        value: What a part of this kind may be, instead of the path of a data file.

    Raises:
        InputError: No such part, or no such file.
    """
    if not is_file(name, FURNITURE if kind == "fixture" else ()):
        found: Path | T = part(kind, name)
        return found
    path = own_file(name)
    if not path.is_file():
        raise InputError(f"no {kind} file '{shown(name, 200)}'")
    return path
