"""``python -m tests.attacks KIND --cases N --seed S [--seconds T]``: attack, and count."""

from __future__ import annotations

import argparse
import importlib
import logging
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

from tests.attacks.watch import Count, Watch, baited

KINDS = ("logs", "trajectories", "replays", "yaml_files", "settings", "checkpoints", "ros_messages")
"""Modules beside this one. Each has ``begin(folder, bait)``, which gives a function that makes a case (to be
called once) from a random generator."""


def attack(kind: str, cases: int, seed: int, seconds: float = float("inf"), only: int | None = None) -> Count:
    """Run the cases of a kind; a case's number and the seed make it again.

    Args:
        kind: One of `KINDS`.
        cases: How many at most.
        seed: Of all of them.
        seconds: No case is begun later.
        only: Number of the only case to run.
    """
    warnings.simplefilter("ignore")
    logging.disable(logging.CRITICAL)
    with tempfile.TemporaryDirectory() as name, baited(Path(name)) as bait:
        folder = Path(name) / "cases"
        folder.mkdir()
        make = importlib.import_module(f"tests.attacks.{kind}").begin(folder, bait)
        watch, until = Watch(bait), time.monotonic() + seconds
        for number in range(cases) if only is None else [only]:
            if time.monotonic() > until:
                break
            watch.judge(number, make(np.random.default_rng([seed, number])))
    return watch.count


def main() -> int:
    """Returns 1 where there was a violation."""
    parser = argparse.ArgumentParser(prog="python -m tests.attacks", description=__doc__)
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--only", type=int, help="number of the only case to run")
    options = parser.parse_args()
    started = time.monotonic()
    count = attack(options.kind, options.cases, options.seed, options.seconds, options.only)
    print(
        f"{options.kind}: {count.cases} cases in {time.monotonic() - started:.0f} s: {count.right} right "
        f"results, {count.errors} clear errors, {len(count.violations)} violations"
    )
    for said, times in Counter(said for _, said in count.violations).most_common(30):
        first = next(number for number, other in count.violations if other == said)
        print(f"  {times} x {said} (first in case {first})")
    return 1 if count.violations else 0


if __name__ == "__main__":
    sys.exit(main())
