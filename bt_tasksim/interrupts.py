"""Ctrl-C while processes start: it reaches this process, and none of those that it starts."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker


@contextmanager
def held_back(spawning: bool = False) -> Iterator[None]:
    """SIGINT to this thread waits until the end of the block; processes started in it never receive one.

    A terminal sends SIGINT to all processes in front. A worker that it ends between two lines may leave a
    lock taken, for which its parent then waits for ever; the parent ends the workers instead.

    Args:
        spawning: Processes are spawned in the block, not forked.
    """
    if spawning:
        resource_tracker.ensure_running()  # would start in the block otherwise, and lets SIGINT through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
