"""Synthetic demonstrations of whatever a tree does: ``python -m bt_tasksim.execution.performed``.

    python -m bt_tasksim.execution.performed open_drawer --episodes 10 --seed 0 --out opened.h5

The tree runs in simulation, and successful runs become recordings of a hand with the errors of one (see
`bt_tasksim.demos_decomp.synthetic_runs`), with what was really done when in ``labels/...`` beside each.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bt_tasksim.core.errors import BtTasksimError, InputError, NoDrawError
from bt_tasksim.core.files import check_writable
from bt_tasksim.demos_decomp.log import Demonstration, Log
from bt_tasksim.demos_decomp.log_file import write_log
from bt_tasksim.demos_decomp.synthetic import TaskLabel
from bt_tasksim.demos_decomp.synthetic_motion import Sensing
from bt_tasksim.demos_decomp.synthetic_runs import as_person
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.run_log import RunRecorder
from bt_tasksim.execution.runner import Runner
from bt_tasksim.trees.load import TreeSource, load_source

TRIES = 5
"""Draws for each demonstration that is wanted, after which a tree is taken to fail."""


def performed(
    source: TreeSource, seeds: Iterable[int], sensing: Sensing | None = None, engines: str = "sapien"
) -> Iterator[tuple[Demonstration, list[TaskLabel]]]:
    """Demonstrations of a tree in its scene, one for each of these draws that succeeds.

    Args:
        source: The tree and its scene.
        seeds: Seeds of the draws.
        sensing: Quality of the recording.
        engines: Name of the physics engine.

    Raises:
        InputError: Tree or scene are no good.
        MachineError: The engine cannot start.
    """
    runner = Runner(source.build(), source.scene, EngineOptions(engines=engines, noise="none"))
    recorder = RunRecorder(runner)
    try:
        for seed in seeds:
            try:
                result = runner.run(seed, record=recorder)
            except NoDrawError:
                continue
            if result.success:
                yield as_person(recorder.demonstration(result), recorder.nodes, seed, sensing, f"{seed:03d}")
    finally:
        runner.close()


def labelled(demonstration: Demonstration, labels: Sequence[TaskLabel]) -> Demonstration:
    """The same with what was really done when: concepts, and their first and last seconds."""
    import h5py

    text = np.array([label.concept for label in labels], dtype=h5py.string_dtype())
    spans = np.array([(label.start, label.end) for label in labels], float).reshape(-1, 2)
    return replace(demonstration, extra={"labels/concept": text, "labels/seconds": spans})


def main(arguments: Sequence[str] | None = None) -> int:
    """Write a log of demonstrations."""
    parser = argparse.ArgumentParser(description="Synthetic demonstrations of a tree, from simulation.")
    parser.add_argument("tree", help="a ready-made scenario, or a tree file with its scene")
    parser.add_argument("--robot", help="by default the scene's")
    parser.add_argument("--episodes", type=int, default=10, metavar="N")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="first seed, default 0")
    parser.add_argument("--engines", default="sapien")
    parser.add_argument("--out", type=Path, required=True, help="the log, an HDF5 file")
    asked = parser.parse_args(arguments)
    try:
        if asked.episodes < 1:
            raise InputError(f"'--episodes' should be at least 1, found {asked.episodes}")
        check_writable(asked.out)
        source = load_source(asked.tree, asked.robot, None)
        seeds = range(asked.seed, asked.seed + TRIES * asked.episodes)
        shown = itertools.islice(performed(source, seeds, engines=asked.engines), asked.episodes)
        found = [labelled(*each) for each in shown]
        if len(found) < asked.episodes:
            raise InputError(
                f"'{asked.tree}' succeeded in {len(found)} of {len(seeds)} draws, and {asked.episodes} "
                f"demonstrations were asked for: nothing was written"
            )
        write_log(asked.out, Log("synthetic", tuple(found), f"Made up in simulation: {asked.tree}."))
    except BtTasksimError as error:
        sys.stderr.write(f"{error}\n")
        return 2 if isinstance(error, InputError) else 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
