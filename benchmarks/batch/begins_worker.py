"""What `benchmarks.batch.begins` measures of the code of this checkout and of another one.

Imported for this one. For the other it is run by its path, with ``PYTHONPATH`` set to that checkout, and uses
what both codes have; it reads ``FIRST LAST`` from its input, line by line, and says what it measured.

    python -P begins_worker.py WORLDS
"""

from __future__ import annotations

import sys
import time
from typing import Any
from unittest import mock


def measured(episodes: Any, seeds: range) -> tuple[int, float, float]:
    """Control steps of whole episodes, how many a second, and microseconds of PhysX's own in each.

    Args:
        episodes: A batch, see `benchmarks.batch.episodes.Episodes`.
        seeds: Of the episodes; they are run once more for PhysX's time.
    """
    from sapien import physx

    started = time.perf_counter()
    steps = episodes.whole(seeds)
    rate = steps / (time.perf_counter() - started)
    step, spent = physx.PhysxCpuSystem.step, 0.0

    def timed(system: Any) -> None:
        nonlocal spent
        began = time.perf_counter()
        step(system)
        spent += time.perf_counter() - began

    with mock.patch.object(physx.PhysxCpuSystem, "step", timed):
        episodes.whole(seeds)
    return steps, rate, 1e6 * spent / steps


def main() -> None:
    """Measure as often as asked."""
    from benchmarks.batch.episodes import Episodes

    episodes = Episodes(int(sys.argv[1]), 1)
    for line in sys.stdin:
        print("measured", *measured(episodes, range(*map(int, line.split()))), flush=True)


if __name__ == "__main__":
    main()
