"""Clocks of the tick loop: as fast as possible, or in real time.

In real time ticks begin at absolute times on a monotonic clock, so that errors do not add up. A tick that is
late is never made up for: the periods that it missed are skipped, and one fresh command follows.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Protocol

import numpy as np

PUNCTUAL = 0.002
"""Seconds by which a tick may be late and still counts as punctual."""
GRACE = 0.1
"""Share of a period by which a tick may be late and still begin at once. A later one waits for the next
period: commands that follow each other faster than planned would move the arm faster than planned."""


@dataclass(frozen=True)
class Timing:
    """How well a run kept its rate; times in seconds.

    Attributes:
        period: Control period.
        ticks: Ticks that were waited for.
        punctual: Share of all periods, skipped ones included, whose tick began within 2 ms of its time.
        median: Of how late ticks began.
        p99: Likewise.
        worst: Likewise.
        overruns: Ticks that took so long that the next one could not begin on time.
        skipped: Periods without a tick.
        latency_median: From the measurement of the joint states to the command that follows from them; None
            where there is no real robot.
        latency_p99: Likewise.
    """

    period: float
    ticks: int
    punctual: float
    median: float
    p99: float
    worst: float
    overruns: int
    skipped: int
    latency_median: float | None = None
    latency_p99: float | None = None

    def __str__(self) -> str:
        """One sentence."""
        said = (
            f"{1 / self.period:.3g} Hz: {100 * self.punctual:.1f} % of {self.ticks + self.skipped} ticks "
            f"within 2 ms, late by {1000 * self.median:.2f} ms (median), {1000 * self.p99:.2f} ms (99 %), "
            f"{1000 * self.worst:.1f} ms (worst); {self.overruns} overruns, {self.skipped} periods skipped"
        )
        if self.latency_median is not None and self.latency_p99 is not None:
            said += (
                f"; from state to command {1000 * self.latency_median:.1f} ms (median), "
                f"{1000 * self.latency_p99:.1f} ms (99 %)"
            )
        return said


class Clock(Protocol):
    """What the tick loop waits for."""

    def start(self, period: float) -> None:
        """Begin a run: the first tick is now."""

    def wait(self) -> None:
        """Wait until the next tick begins."""

    def acted(self, latency: float) -> None:
        """A command went out, so many seconds after the state that it follows from was measured."""

    def timing(self) -> Timing | None:
        """How well the rate was kept; None where there is none to keep."""


class FreeClock:
    """As fast as possible."""

    def start(self, period: float) -> None:
        """See `Clock.start`."""

    def wait(self) -> None:
        """Does not wait."""

    def acted(self, latency: float) -> None:
        """See `Clock.acted`."""

    def timing(self) -> Timing | None:
        """None."""
        return None


class RealTimeClock:
    """Real time, by `time.monotonic`."""

    def __init__(self) -> None:
        self.start(math.inf)

    def start(self, period: float) -> None:
        """See `Clock.start`."""
        self._period = period
        self._began = time.monotonic()
        self._tick = 0
        self._overruns = self._skipped = 0
        self._late: list[float] = []
        self._latency: list[float] = []

    def wait(self) -> None:
        """Sleep until the next tick's time; see `next_tick` where that has passed."""
        ready = time.monotonic() - self._began
        due = self._tick + 1
        self._tick = next_tick(self._tick, ready, self._period)
        self._overruns += ready > due * self._period
        self._skipped += self._tick - due
        begins = self._tick * self._period
        while (now := time.monotonic() - self._began) < begins:
            time.sleep(begins - now)
        self._late.append(now - begins)

    def acted(self, latency: float) -> None:
        """See `Clock.acted`."""
        self._latency.append(latency)

    def timing(self) -> Timing | None:
        """See `Clock.timing`."""
        if not self._late:
            return None
        late = np.array(self._late)
        latency = np.array(self._latency)
        return Timing(
            period=self._period,
            ticks=len(late),
            punctual=float(np.count_nonzero(late <= PUNCTUAL)) / (len(late) + self._skipped),
            median=float(np.median(late)),
            p99=float(np.percentile(late, 99)),
            worst=float(late.max()),
            overruns=self._overruns,
            skipped=self._skipped,
            latency_median=float(np.median(latency)) if len(latency) else None,
            latency_p99=float(np.percentile(latency, 99)) if len(latency) else None,
        )


def next_tick(last: int, ready: float, period: float) -> int:
    """Number of the next tick.

    Args:
        last: Number of the last tick, which began at ``last * period``.
        ready: Seconds since tick 0 at which the last one was done.
        period: Seconds.

    Returns:
        The tick after the last one where it has not begun yet, or has by no more than `GRACE` of a period;
        else the first one that has not.
    """
    due = last + 1
    if ready <= (due + GRACE) * period:
        return due
    reached = math.floor(ready / period)
    return reached if ready <= (reached + GRACE) * period else reached + 1
