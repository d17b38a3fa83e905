"""``bt-tasksim convert``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bt_tasksim.cli.streams import say
from bt_tasksim.core.registry import register


@register("command", "convert")
def convert(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Python files of your own.")],
    check: Annotated[
        bool,
        typer.Option("--check", help="Change nothing; print what would change; exit code 1 if any."),
    ] = False,
) -> int:
    """Update your Python files from version 0.1.

    Modules have moved since: imports are changed, in place, to where things are now.
    """
    from bt_tasksim.cli.convert import convert_files

    lines, changes = convert_files(files, check)
    say(*lines)
    return 1 if check and changes else 0
