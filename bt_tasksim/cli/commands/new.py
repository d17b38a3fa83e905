"""``bt-tasksim new``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from bt_tasksim.cli.streams import say
from bt_tasksim.core.registry import register


@register("command", "new")
def new(
    kind: Annotated[Literal["concept"], typer.Argument(metavar="concept", help="What to begin.")],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Its name, such as push or wipe_table.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Write the files to this folder.")] = Path(),
    like: Annotated[
        str | None,
        typer.Option(
            metavar="EXAMPLE", help="Begin with a worked example: push.  [default: a template to fill in]"
        ),
    ] = None,
) -> None:
    """Start a concept of your own.

    Writes the concept's file, the tree in which it is trained, and its test.
    """
    from bt_tasksim.checking.new_concept import write_concept

    say(write_concept(name, out, like))
