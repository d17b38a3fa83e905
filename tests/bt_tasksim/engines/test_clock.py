"""Clocks: absolute times without drift, late ticks that are skipped and never made up for."""

import time
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.engines import clock as pacing
from bt_tasksim.engines.clock import GRACE, FreeClock, RealTimeClock, Timing, next_tick
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.trees.load import load_source


@pytest.mark.parametrize(
    ("last", "ready", "tick"),
    [
        (0, 0.2, 1),
        (0, 1.0, 1),
        (0, 1.05, 1),
        (0, 1.2, 2),
        (0, 1.9, 2),
        (0, 2.05, 2),
        (3, 9.5, 10),
        (3, 9.0, 9),
    ],
)
def test_the_next_tick(last, ready, tick):
    assert next_tick(last, ready, 1.0) == tick


@given(st.lists(st.floats(0.0, 5.0), min_size=1, max_size=50))
def test_ticks_lie_on_the_grid_and_never_follow_too_closely(durations):
    tick, began = 0, 0.0
    for duration in durations:
        ready = began + duration
        after = next_tick(tick, ready, 1.0)
        starts = max(ready, float(after))
        assert after > tick and starts - after <= GRACE + 1e-9
        assert starts - began >= 1.0 - GRACE - 1e-9, "two commands too close to each other"
        assert starts - ready <= 1.0 + 1e-9, "it waits no longer than a period"
        tick, began = after, starts


def test_a_run_in_real_time_does_not_drift_and_counts_what_was_late():
    clock, period = RealTimeClock(), 0.02
    clock.start(period)
    began = time.monotonic()
    for k in range(20):
        clock.acted(0.003)
        if k == 9:
            time.sleep(2.5 * period)
        clock.wait()
    took = time.monotonic() - began
    timing = clock.timing()
    assert timing.ticks == 20 and timing.overruns >= 1 and timing.skipped >= 2
    assert 0.0 <= took - (20 + timing.skipped) * period < period, "errors do not add up"
    assert timing.worst >= timing.p99 >= timing.median >= 0.0
    assert timing.latency_median == pytest.approx(0.003)
    assert "50 Hz" in str(timing) and "from state to command 3.0 ms" in str(timing)


def test_late_and_skipped_ticks_are_not_punctual(monkeypatch):
    now = [0.0]
    sleep = lambda seconds: now.__setitem__(0, now[0] + seconds)  # noqa: E731
    monkeypatch.setattr(pacing, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=sleep))
    clock = RealTimeClock()
    clock.start(0.1)
    for k in range(20):
        sleep({9: 0.25, 15: 0.105}.get(k, 0.01))  # two periods are skipped, and one tick begins 5 ms late
        clock.wait()
    timing = clock.timing()
    assert (timing.overruns, timing.skipped) == (2, 2) and timing.worst == pytest.approx(0.005)
    assert timing.punctual == pytest.approx(19 / 22)


def test_as_fast_as_possible_reports_nothing():
    clock = FreeClock()
    clock.start(10.0)
    clock.wait()
    assert clock.timing() is None and RealTimeClock().timing() is None


def test_a_simulation_in_real_time_takes_its_time_and_is_the_same_otherwise():
    source = load_source("pick_and_place")
    results = []
    for options in (EngineOptions(), EngineOptions(real_time=True)):
        runner = Runner(source.build(), source.scene, options, longest=0.6)
        seen = []
        began = time.monotonic()
        result = runner.run(3, record=lambda step, seen=seen: seen.append(step.observation.tool_pose))
        results.append((result, np.array(seen), time.monotonic() - began))
        runner.close()
    (free, fast, _), (paced, slow, took) = results
    assert free.timing is None and isinstance(paced.timing, Timing)
    assert paced.timing.period == 0.05 and paced.timing.ticks >= 12 and took >= 0.6
    assert np.array_equal(fast, slow)
