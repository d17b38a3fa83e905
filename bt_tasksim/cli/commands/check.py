"""``bt-tasksim check``."""

from __future__ import annotations

from typing import Annotated

import typer

from bt_tasksim.cli.progress import progress
from bt_tasksim.cli.streams import say
from bt_tasksim.core.registry import register


@register("command", "check")
def check(
    file: Annotated[str, typer.Argument(metavar="FILE", help="The Python file that defines it.")],
    tree: Annotated[
        str | None,
        typer.Option(
            metavar="TREE",
            help="The tree to try it in.  [default: the one in FILE or train_FILE, or a scenario]",
        ),
    ] = None,
) -> int:
    """Check a concept of your own and say what to mend."""
    from bt_tasksim.checking import concept_file

    with progress("checking", None):
        report = concept_file.check(file, tree)
    say(*report.lines())
    return 2 if report.errors else 0
