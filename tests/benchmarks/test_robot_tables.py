"""Tables of the twin: every measured number has a cell, and what is bad is said."""

from __future__ import annotations

import math
from typing import Any

from benchmarks import robot_tables
from benchmarks.faults import FAULTS
from benchmarks.gap import ENGINES, GRASPS, SCENARIOS


def test_without_measurements_nothing_is_claimed() -> None:
    for name in ("gap", "faults", "loop"):
        lines = robot_tables.TABLES[name]({}).splitlines()[2:]
        assert lines and all("not measured" in line and " of " not in line[20:] for line in lines[:1])


def test_the_gap_has_a_cell_for_each_engine_and_a_line_for_each_failure() -> None:
    outcomes = [
        {"seed": 7, "success": False, "reason": "x", "why": "it | fell"},
        {"seed": 8, "success": True},
    ]
    row = {"successes": 1, "episodes": 2, "confidence_interval": [0.09, 0.91], "outcomes": outcomes}
    found = {f"gap-{s}-{g}-{e}": row for s in SCENARIOS for g in GRASPS for e in ENGINES}
    lines = robot_tables.gap(found).splitlines()[2:]
    assert len(lines) == len(SCENARIOS) * len(GRASPS)
    assert all(line.count("1 of 2 (9.0 to 91.0 %)") == len(ENGINES) for line in lines)
    failures = robot_tables.gap_failures(found).splitlines()[2:]
    assert len(failures) == len(found) and all("| 7 | it \\| fell |" in line for line in failures)


def test_a_late_hold_is_not_hidden_by_the_others() -> None:
    def seen(held: float, **changes: Any) -> dict[str, Any]:
        return {
            "held": held, "still": 2 * held, "far": math.nan, "running": [], "again": True,
            "by": "stale: joint states are 110 ms old", "said": "a | b", **changes,
        }  # fmt: skip

    row = [seen(0.1), seen(0.3), seen(0.11, by="stale: 120 ms", again=False)]
    found = {"faults": {FAULTS[0]: row}}
    line = robot_tables.faults(found).splitlines()[2]
    assert "| 110, 300 ms (1 late) | 600 ms | not known | 2 of 3 | stale |" in line
    assert len(robot_tables.faults(found).splitlines()) == 2 + len(FAULTS)
    assert f"| {FAULTS[0]} | `a / b` |" in robot_tables.messages(found)


def test_the_loop_says_all_that_was_measured() -> None:
    found = {
        "period": 0.02, "ticks": 30_000, "minutes": 10.0, "punctual": 0.98765, "median": 1e-4, "p99": 2e-3,
        "worst": 0.01, "overruns": 3, "skipped": 1, "latency_median": 0.0095, "latency_p99": 0.015,
        "shortest_way": 0.002,
    }  # fmt: skip
    text = robot_tables.loop({"loop": found})
    for said in (
        "30000 at 50 Hz, 10 minutes",
        "98.77 %",
        "0.10, 2.00, 10.00 ms",
        "3, 1",
        "9.5, 15.0 ms",
        "2.0 ms",
    ):
        assert f"| {said} |" in text
