"""The command ``bt-tasksim``.

Bad input ends with one sentence and exit code 2, and so does an exception in a plugin's code; a failing
machine with 1, an interrupt with 130, SIGTERM with 143. What comes from a user's own code names its file and
line. Everything heavy is imported by the command that needs it.
"""

from __future__ import annotations

import logging
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import typer

from bt_tasksim.cli.app import NAME, application
from bt_tasksim.cli.options.plugins import taken
from bt_tasksim.cli.streams import complain, flush_or_discard, open_missing, spell_out
from bt_tasksim.core.culprit import users_place, with_place
from bt_tasksim.core.errors import BtTasksimError, BtTasksimWarning, InputError, Terminated, is_bad_path

COMPLETE = f"_{NAME.replace('-', '_').upper()}_COMPLETE"
"""Environment variable by which a shell asks how a word may go on."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        arguments: Words of the command line; by default those of the process.

    Returns:
        The exit code.
    """
    open_missing()
    spell_out()
    logging.basicConfig(format=f"{NAME}: %(message)s", level=logging.WARNING)
    try:
        with _said_once():
            code = _run(list(sys.argv[1:] if arguments is None else arguments))
        sys.stdout.flush()
    except KeyboardInterrupt as stop:
        ended = isinstance(stop, Terminated)
        complain(f"{'terminated' if ended else 'interrupted'}{f'; {stop}' if str(stop) else ''}")
        return 143 if ended else 130
    except InputError as error:
        complain(f"{NAME}: {with_place(error)}")
        return 2
    except BtTasksimError as error:
        complain(f"{NAME}: {with_place(error)}")
        return 1
    except BrokenPipeError:
        flush_or_discard()
        return 1
    except OSError as error:
        flush_or_discard()
        where = f" '{error.filename}'" if error.filename else ""
        complain(f"{NAME}: {error.strerror or error}{where}")
        return 2 if is_bad_path(error) else 1
    except Exception as error:
        if not (place := users_place(error)):
            raise
        complain(f"{NAME}: {place}: {type(error).__name__}: {error}")
        return 2
    return code


def _run(words: list[str]) -> int:
    if COMPLETE in os.environ:
        application().main(words, prog_name=NAME)
    plugins, words = taken(words)
    if plugins:
        from bt_tasksim.concept.plugins import load_parts

        for plugin in plugins:
            load_parts(plugin)
    group = application()
    try:
        with group.make_context(NAME, words or ["--help"]) as context:
            return int(group.invoke(context) or 0)
    except typer.Exit as end:
        return end.exit_code


@contextmanager
def _said_once() -> Iterator[None]:
    """Warnings of ours are sentences, each said once; those of libraries come as ever."""
    said: set[str] = set()
    with warnings.catch_warnings():
        shown = warnings.showwarning
        warnings.simplefilter("always", BtTasksimWarning)

        def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
            if not issubclass(category, BtTasksimWarning):
                shown(message, category, *where, **more)
            elif str(message) not in said:
                said.add(str(message))
                complain(f"{NAME}: {message}")

        warnings.showwarning = show
        yield
