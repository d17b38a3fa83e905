"""The loop at 50 Hz over ROS: how well ticks keep their time, and how long a state takes to become a command.

``python -m benchmarks.loop --minutes 10 --json benchmarks/results/loop.json`` moves the twin's arm to and fro
for ten minutes. Bridge, twin, watchdog and runner share the machine.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.faults import bench_of
from benchmarks.sweep import SCENE, sweeping
from bt_tasksim.core.files import write_text
from bt_tasksim.engines.clock import Timing


def measure(minutes: float, rate: int, domain: int) -> tuple[str, str, Timing, float]:
    """Status, sentence and timing of one run of so many minutes, and the shortest way of a state in seconds.

    The engine takes the shortest delay of a message for a difference of clocks. Here there is one clock, and
    so the delay is known: latencies count from when a state was stamped.
    """
    with bench_of(domain) as bench:
        runner, sweep = sweeping(bench.twin.port)
        sweep.lasts = 60.0 * minutes
        configuration = dataclasses.replace(SCENE.sample(0), control_frequency=rate)
        bench.evaluation.load(configuration)
        try:
            result = runner.finish(configuration, runner.reset(configuration))
            assert result.timing is not None
            engine: Any = runner.pipeline.physics
            way = shortest_way(engine.engine.joints.offset)
        finally:
            runner.close()
    return result.status.name, result.why, with_way(result.timing, way), way


def shortest_way(offset: float) -> float:
    """Seconds that a state takes at least, on one machine.

    Args:
        offset: From stamps of `time.time` to `time.monotonic`, as states tell it; see `JointFeed`.
    """
    return offset - (time.monotonic() - time.time())


def with_way(timing: Timing, way: float) -> Timing:
    """The timing with latencies that begin so many seconds earlier."""
    assert timing.latency_median is not None and timing.latency_p99 is not None
    return dataclasses.replace(
        timing, latency_median=timing.latency_median + way, latency_p99=timing.latency_p99 + way
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=0.2)
    parser.add_argument("--rate", type=int, default=50, metavar="HZ")
    parser.add_argument("--domain", type=int, default=44)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(arguments)
    status, why, timing, way = measure(options.minutes, options.rate, options.domain)
    print(f"{options.minutes:g} minutes, ended {status}: {why}")
    print(f"{timing}, of which the shortest way of a state is {1000 * way:.1f} ms")
    if options.json:
        content = {"minutes": options.minutes, "status": status, "why": why, "shortest_way": way}
        content |= dataclasses.asdict(timing)
        write_text(options.json, json.dumps(content, indent=1) + "\n")
    return 0 if status == "SUCCESS" else 1


if __name__ == "__main__":
    sys.exit(main())
