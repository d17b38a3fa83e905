"""A run as the commands make it: a folder is written, a bar is shown, one line says what became of it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from bt_tasksim.cli.progress import progress
from bt_tasksim.cli.streams import say
from bt_tasksim.core.plain import printable

if TYPE_CHECKING:
    from py_trees.behaviour import Behaviour

    from bt_tasksim.execution.pipelines import EngineOptions
    from bt_tasksim.execution.result import Result
    from bt_tasksim.report.video import Film
    from bt_tasksim.scene.scene import WorldSource


def run_into(
    folder: Path,
    tree: Behaviour,
    scene: WorldSource,
    seed: int,
    engines: EngineOptions,
    name: str,
    film: Film | None = None,
    longest: float | None = None,
) -> Result:
    """Run a tree once, keep everything of it in a folder, and print what became of it.

    Args:
        folder: Where to.
        tree: The tree's root.
        scene: The scene.
        seed: Seed of the draw.
        engines: Which engines; where they say rendering and this machine cannot draw, the run is not filmed.
        name: What is run: a scenario's name or the tree's file.
        film: How it is filmed, where engines say rendering; None as by default.
        longest: Seconds of the episode after which it is stopped; None as by default.

    Raises:
        InputError: The folder, the tree or the scene is no good, or an object begins in the robot.
        MachineError: An engine failed, or the disk is full or not writable.
    """
    from bt_tasksim.execution.runner import LONGEST, Runner
    from bt_tasksim.report.report import NO_VIDEO
    from bt_tasksim.report.write import filming_runner, write_run

    why, longest = "", longest or LONGEST
    if engines.rendering:
        runner, why = filming_runner(tree, scene, engines, longest)
        if why:
            print(f"(without video: {why})", file=sys.stderr)
    else:
        runner = Runner(tree, scene, engines, longest=longest)
    try:
        with progress("running", None):
            result, files = write_run(
                folder, runner, seed, scenario=name, film=film, no_video=why or NO_VIDEO
            )
    finally:
        runner.close()
    for remark in files.remarks:
        say(remark)
    say(printable(f"{result}; results: {files.folder / 'report.html'}"))
    return result
