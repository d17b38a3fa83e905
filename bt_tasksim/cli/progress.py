"""A progress bar on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def progress(what: str, total: int | None) -> Iterator[Callable[[bool], None]]:
    """A progress bar on a terminal, shown from the second second on; nothing elsewhere."""
    if not sys.stderr.isatty():
        yield lambda success: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns: list[Any] = [TextColumn("{task.description}"), BarColumn()]
    if total is not None:
        columns += [MofNCompleteColumn(), TextColumn("{task.fields[rate]}"), TimeRemainingColumn()]
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total, rate="")
        counts = [0, 0]

        def advance(success: bool) -> None:
            counts[0] += success
            counts[1] += 1
            bar.update(task, advance=1, rate=f"{100 * counts[0] / counts[1]:.0f} % success")

        yield advance
