"""How much of a process's memory is not its engine's own: what unfinished messages take up."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

OWN = 1 << 30
"""Bytes by which an engine may make its process grow."""


class MemoryWatch:
    """Tells what the engine needs from what comes beside it.

    ZeroMQ keeps the frames of a message until its last one has come, and has no limit on their number, nor
    does it wait for the engine. So only what a new world takes is the engine's own, and only up to a bound.
    Where the system does not say how large a process is, nothing ever grows.

    Args:
        own: Bytes by which the engine may make the process grow.
    """

    def __init__(self, own: int = OWN) -> None:
        self._own = own
        self.renew()

    def renew(self) -> None:
        """What the process has now is its own."""
        self._usual = resident()
        self._most = self._usual + self._own

    @contextmanager
    def own(self) -> Iterator[None]:
        """What the process has after the block is its own, as far as the bound allows."""
        self._usual = self._most  # how much of it is needed shows at the end
        try:
            yield
        finally:
            self._usual = min(resident(), self._most)

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
