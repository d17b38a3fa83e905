"""The button of the emergency stop, as the twin plays it: it says that it is not pressed, over and over."""

from __future__ import annotations

import math
from collections import deque

FORGOTTEN = 1.0
"""Seconds after which the twin will not hear its own word any more."""


class ReleaseAnnouncer:
    """Says when to speak, and tells the twin's own word from others', since it hears both on one topic.

    Its own word must not undo what another one has pressed meanwhile, so as many releases as it has said
    itself, and not heard yet, count for nothing.

    Args:
        every: Longest time in seconds between two messages; infinite: it never speaks.
    """

    def __init__(self, every: float) -> None:
        self._period = every / 3.0
        self._last = -math.inf
        self._own: deque[float] = deque()

    def speaks(self, pressed: bool, now: float) -> bool:
        """Whether to say at this moment, seconds, that it is not pressed; nothing is said while it is."""
        if pressed or math.isinf(self._period) or now - self._last < self._period:
            return False
        self._last = now
        self._own.append(now)
        return True

    def is_own(self, pressed: bool, now: float) -> bool:
        """Whether a message that was heard at a moment, seconds, counts for nothing."""
        while self._own and now - self._own[0] > FORGOTTEN:
            self._own.popleft()
        if pressed or not self._own:
            return False
        self._own.popleft()
        return True
