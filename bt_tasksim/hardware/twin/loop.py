"""The twin's loop: steps in real time, and between them whatever has come in. Knows nothing of ROS."""

from __future__ import annotations

import time
from collections.abc import Callable

LATE = 0.1
"""Seconds by which physics may lag and still catch up; more is left out."""
AT_LEAST = 8
"""Messages that are taken between two steps, however late the next one is: one of each topic, and more."""


def hear(take: Callable[[float], None], until: float) -> None:
    """Take messages until a moment; where that has passed already, some all the same.

    Args:
        take: Waits so many seconds for a message at most, and takes one that is there.
        until: Seconds of `time.monotonic`.
    """
    if time.monotonic() >= until:
        for _ in range(AT_LEAST):
            take(0.0)
        return
    while (left := until - time.monotonic()) > 0.0:
        take(left)


def run(
    period: float,
    going: Callable[[], bool],
    take: Callable[[float], None],
    step: Callable[[], None],
    leave_out: Callable[[float], None],
) -> None:
    """Step once a period of real time.

    Args:
        period: Seconds.
        going: Says whether to go on.
        take: See `hear`.
        step: One step.
        leave_out: Told of seconds by which the loop lagged, and which it leaves out.
    """
    due = time.monotonic() + period
    while going():
        hear(take, due)
        step()
        due += period
        behind = time.monotonic() - due
        if behind > LATE:
            leave_out(behind)
            due = time.monotonic()
