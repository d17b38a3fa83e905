"""``--plugin``, which every command has: it is taken off the command line before anything else is read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from bt_tasksim.core.errors import InputError

OPTION = "--plugin"
Plugins = Annotated[
    list[str],
    typer.Option(
        OPTION,
        metavar="FILE_OR_MODULE",
        help="Load parts from outside: a .py file or an importable module; repeatable.",
    ),
]


def taken(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """The plugins that a command line names, wherever, and the other words.

    Args:
        words: The words; whatever stands behind ``--`` is left alone.

    Raises:
        InputError: ``--plugin`` is the last word.
    """
    plugins: list[str] = []
    others: list[str] = []
    rest = iter(words)
    for word in rest:
        if word == "--":
            return plugins, [*others, word, *rest]
        if word == OPTION:
            plugin = next(rest, "")
        elif word.startswith(f"{OPTION}="):
            plugin = word.removeprefix(f"{OPTION}=")
        else:
            others.append(word)
            continue
        if not plugin:
            raise InputError(f"{OPTION} needs a Python file or the name of a module")
        plugins.append(plugin)
    return plugins, others
