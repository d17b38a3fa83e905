"""A log that a flood of bad messages cannot fill: some sentences at once, then a few a second."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable


class RefusalLog:
    """Says one sentence for each refusal, at most so many at a time; several threads may share it.

    Args:
        say: Where sentences go.
        burst: Sentences that may come at once.
        rate: Sentences a second after that; the others are counted, and the count is said with the next one.
        clock: Seconds.
    """

    def __init__(
        self,
        say: Callable[[str], None],
        burst: int = 10,
        rate: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._say, self._burst, self._rate, self._clock = say, float(burst), rate, clock
        self._left, self._then, self._unsaid = self._burst, clock(), 0
        self._lock = threading.Lock()

    def __call__(self, sentence: str) -> None:
        """A refusal, in one sentence."""
        with self._lock:
            now = self._clock()
            self._left = min(self._burst, self._left + self._rate * (now - self._then))
            self._then = now
            if self._left < 1.0:
                self._unsaid += 1
                return
            self._left -= 1.0
            more = f" (before it {self._unsaid} more, not shown)" if self._unsaid else ""
            self._unsaid = 0
            self._say(f"refused: {sentence}{more}")
