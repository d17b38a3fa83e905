"""The twin's loop in real time: it keeps its rate, and hears whatever comes however busy it is."""

from __future__ import annotations

import time

from bt_tasksim.hardware.twin import loop


def ran(steps: int, takes: float, period: float = 0.01) -> tuple[int, list[float], float]:
    """Messages that could be taken, what was left out, and seconds, of steps that each take so long."""
    heard, left_out, done = [], [], []

    def take(timeout: float) -> None:
        heard.append(timeout)
        time.sleep(timeout)

    def step() -> None:
        done.append(True)
        time.sleep(takes)

    began = time.monotonic()
    loop.run(period, lambda: len(done) < steps, take, step, left_out.append)
    return len(heard), left_out, time.monotonic() - began


def test_a_step_a_period() -> None:
    heard, left_out, seconds = ran(20, 0.0)
    assert 0.2 <= seconds < 0.4 and heard >= 20 and not left_out


def test_a_busy_loop_hears_all_the_same() -> None:
    heard, left_out, _ = ran(20, 0.02)
    assert heard >= 19 * loop.AT_LEAST
    assert sum(left_out) > 0.05


def test_what_is_late_is_not_awaited() -> None:
    timeouts: list[float] = []
    loop.hear(timeouts.append, time.monotonic() - 1.0)
    assert timeouts == [0.0] * loop.AT_LEAST
