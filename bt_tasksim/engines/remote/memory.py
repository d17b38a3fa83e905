"""How much of a process's memory is not its engine's own: what unfinished messages take up."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager


class MemoryWatch:
    """Tells growth of this process in calls of the engine from growth beside them.

    ZeroMQ keeps the frames of a message until its last one has come, and has no limit on their number. Where
    the system does not say how large a process is, nothing ever grows.
    """

    def __init__(self) -> None:
        self._usual = resident()

    @contextmanager
    def own(self) -> Iterator[None]:
        """What the process grows by in the block is its own."""
        before = resident()
        try:
            yield
        finally:
            self._usual += resident() - before

    def strange(self) -> int:
        """Bytes that came from elsewhere."""
        return resident() - self._usual


def resident() -> int:
    """Bytes of memory that this process has in use; 0 where the system does not say."""
    try:
        with open("/proc/self/statm", "rb", buffering=0) as table:
            return int(table.read(200).split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0
