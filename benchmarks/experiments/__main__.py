"""``python -m benchmarks.experiments A`` to ``F``: run an experiment, print its table, write and draw it."""

from __future__ import annotations

import argparse
import importlib
import sys
import tempfile
from pathlib import Path

from benchmarks.experiments.common import EXPERIMENTS, PICTURES, RESULTS, Request, read, write

QUICK_DRAWS, QUICK_STEPS = 8, 8192


def main(arguments: list[str] | None = None) -> int:
    """Run one experiment."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.experiments", description=__doc__)
    parser.add_argument("experiment", choices=EXPERIMENTS)
    parser.add_argument("--train", action="store_true", help="train what it needs (E, F); finished runs stay")
    parser.add_argument("--draw", action="store_true", help="pictures alone, from the results that are there")
    parser.add_argument("--frames", action="store_true", help="draw frames of runs (B, C, D), from results")
    parser.add_argument("--policy", help="name or folder of the learned policy; by default the shipped one")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--draws", type=int, help="draws of each measurement")
    parser.add_argument("--steps", type=int, help="decisions of each training")
    parser.add_argument("--quick", action="store_true", help="few draws and steps, into a new folder")
    parser.add_argument("--results", type=Path, help="folder of the results; with --quick, of everything")
    parser.add_argument("--pictures", type=Path, default=PICTURES)
    options = parser.parse_args(arguments)
    request = Request(
        policy=options.policy,
        workers=options.workers,
        draws=options.draws or (QUICK_DRAWS if options.quick else None),
        steps=options.steps or (QUICK_STEPS if options.quick else None),
        results=options.results or RESULTS,
        pictures=options.pictures,
    )
    if options.quick:
        folder = options.results or Path(tempfile.mkdtemp(prefix="bt-tasksim-experiments-"))
        folder.mkdir(exist_ok=True)
        request = Request(
            request.policy, request.workers, request.draws, request.steps, folder, folder, folder / "pictures"
        )
        print(f"quick: everything goes to {folder}; go on with --results {folder}", file=sys.stderr)
    module = importlib.import_module(f"benchmarks.experiments.{EXPERIMENTS[options.experiment]}")
    if options.train:
        if not hasattr(module, "train"):
            parser.error(f"experiment {options.experiment} trains nothing of its own")
        module.train(request)
        return 0
    if options.frames and not hasattr(module, "film"):
        parser.error(f"experiment {options.experiment} has no frames")
    there = options.draw or options.frames
    found = read(options.experiment, request.results) if there else module.measure(request)
    if found is None:
        parser.error(f"there are no results of experiment {options.experiment} to draw yet")
    if not there:
        write(request, options.experiment, found)
    request.pictures.mkdir(parents=True, exist_ok=True)
    if options.frames:
        module.film(found, request)
        return 0
    module.draw(found, request.pictures)
    print(module.table(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
