"""Progress on standard error: a bar on a terminal, lines elsewhere where something takes long."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import ProgressColumn

    from bt_tasksim.training.record import Progress

EVERY = 5
"""Rollouts between two lines where there is no terminal."""


@contextmanager
def progress(what: str, total: int | None) -> Iterator[Callable[[bool], None]]:
    """A progress bar on a terminal; nothing elsewhere.

    Args:
        what: What is going on.
        total: How many steps it has; None where nobody knows.

    Yields:
        To be called after each step, with whether it succeeded.
    """
    if not sys.stderr.isatty():
        yield lambda success: None
        return
    from rich.progress import MofNCompleteColumn, TextColumn, TimeRemainingColumn

    counted = [MofNCompleteColumn(), TextColumn("{task.fields[rate]}"), TimeRemainingColumn()]
    with _bar(*(counted if total is not None else [])) as bar:
        task = bar.add_task(what, total=total, rate="")
        counts = [0, 0]

        def advance(success: bool) -> None:
            counts[0] += success
            counts[1] += 1
            bar.update(task, advance=1, rate=f"{100 * counts[0] / counts[1]:.0f} % success")

        yield advance


@contextmanager
def training_progress() -> Iterator[Callable[[Progress], None]]:
    """A progress bar on a terminal; elsewhere a line every few rollouts."""
    if not sys.stderr.isatty():
        yield _Lines()
        return
    from rich.progress import TextColumn

    from bt_tasksim.training.session import describe

    with _bar(TextColumn("{task.percentage:3.0f} %"), TextColumn("{task.fields[said]}")) as bar:
        task = bar.add_task("training", total=None, said="the first rollout")

        def show(now: Progress) -> None:
            done, total = now.steps
            bar.update(task, description=now.train, completed=done, total=total, said=describe(now))

        yield show


def _bar(*columns: ProgressColumn) -> Bar:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    first = (TextColumn("{task.description}"), BarColumn())
    return Progress(*first, *columns, console=Console(stderr=True), transient=True)


class _Lines:
    """Writes a line for some of the rollouts."""

    def __init__(self) -> None:
        self.count = 0
        self.held: tuple[int, int] | None = None

    def __call__(self, now: Progress) -> None:
        from bt_tasksim.training.session import describe

        done, total = now.steps
        self.count += 1
        if self.count == 1 or self.count % EVERY == 0 or done >= total or now.held_apart != self.held:
            self.held = now.held_apart
            print(f"{now.train}: {done} of {total}, {describe(now)}", file=sys.stderr, flush=True)
        if done >= total:
            self.count = 0
