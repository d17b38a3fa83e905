"""The latency over ROS: what the engine cannot see of it is added."""

from __future__ import annotations

import time

import pytest

from benchmarks.loop import shortest_way, with_way
from bt_tasksim.engines.clock import Timing


def test_the_shortest_way_of_a_state_counts() -> None:
    stamp = time.time()
    arrived = time.monotonic() + 0.009  # nine milliseconds later
    way = shortest_way(arrived - stamp)
    assert way == pytest.approx(0.009, abs=1e-3)
    timing = Timing(0.02, 10, 1.0, 0.0, 0.0, 0.0, 0, 0, latency_median=0.004, latency_p99=0.01)
    found = with_way(timing, way)
    assert found.latency_median == pytest.approx(0.013, abs=1e-3)
    assert found.latency_p99 == pytest.approx(0.019, abs=1e-3)
