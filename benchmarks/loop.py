"""The loop at 50 Hz over ROS: how well ticks keep their time, and how long a state takes to become a command.

``python -m benchmarks.loop --minutes 10 --json benchmarks/results/loop.json`` moves the twin's arm to and fro
for ten minutes. Bridge, twin, watchdog and runner share the machine.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.faults import bench_of
from benchmarks.sweep import SCENE, sweeping
from bt_tasksim.files import write_text
from bt_tasksim.pacing import Timing


def measure(minutes: float, rate: int, domain: int) -> tuple[str, str, Timing]:
    """Status, sentence and timing of one run of so many minutes."""
    with bench_of(domain) as bench:
        runner, leaf = sweeping(bench.twin.port)
        leaf.lasts = 60.0 * minutes
        configuration = dataclasses.replace(SCENE.sample(0), control_frequency=rate)
        bench.evaluation.load(configuration)
        try:
            result = runner.finish(configuration, runner.reset(configuration))
        finally:
            assert runner.pipeline is not None
            runner.pipeline.close()
    assert result.timing is not None
    return result.status.name, result.why, result.timing


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=0.2)
    parser.add_argument("--rate", type=int, default=50, metavar="HZ")
    parser.add_argument("--domain", type=int, default=44)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(arguments)
    status, why, timing = measure(options.minutes, options.rate, options.domain)
    print(f"{options.minutes:g} minutes, ended {status}: {why}")
    print(timing)
    if options.json:
        content = {"minutes": options.minutes, "status": status, "why": why, **dataclasses.asdict(timing)}
        write_text(options.json, json.dumps(content, indent=1) + "\n")
    return 0 if status == "SUCCESS" else 1


if __name__ == "__main__":
    sys.exit(main())
