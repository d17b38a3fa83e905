"""A run's folder: everything that is left of a run, written whole or not at all."""

from __future__ import annotations

import contextlib
import dataclasses
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from py_trees.behaviour import Behaviour

from bt_tasksim.core.errors import BtTasksimError, InputError, MachineError
from bt_tasksim.core.files import whole_folder, write_text
from bt_tasksim.demos_decomp.log import Video
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.result import Result
from bt_tasksim.execution.run_log import RunRecorder, about
from bt_tasksim.execution.runner import LONGEST, Runner, Step
from bt_tasksim.report.report import NO_VIDEO, write_report
from bt_tasksim.report.tree_picture import tree_svg
from bt_tasksim.report.video import Film, VideoRecorder
from bt_tasksim.scene.scene import WorldSource

RESULT, LOG, TREE, VIDEO, REPORT = "result.json", "run.h5", "tree.svg", "run.mp4", "report.html"
FILES = (RESULT, LOG, TREE, VIDEO, REPORT)
"""Names of the files in a run's folder, which a later run may replace."""
LEAST = 2
"""Ticks of a run that are worth keeping when it is interrupted."""


@dataclass(frozen=True)
class RunFiles:
    """What was written.

    Attributes:
        folder: The run's folder.
        paths: The files in it, by name.
        remarks: A sentence for each file that could not be made.
    """

    folder: Path
    paths: dict[str, Path]
    remarks: tuple[str, ...] = ()


def write_run(
    folder: str | Path,
    runner: Runner,
    seed: int = 0,
    *,
    scenario: str = "",
    stream: str = "evaluation",
    film: Film | None = None,
    no_video: str = NO_VIDEO,
    watch: Callable[[Step], None] | None = None,
) -> tuple[Result, RunFiles]:
    """Run a tree once and keep everything of it in a folder; film it if the runner's options say rendering.

    Args:
        folder: Where to; an existing folder is replaced if it holds nothing but a run's files.
        runner: The runner.
        seed: Seed of the draw.
        scenario: What is run: a scenario's name or the tree's file.
        stream: Stream of draws.
        film: How it is filmed, where the runner's options say rendering; None as by default.
        no_video: One sentence for the report where the run is not filmed: why.
        watch: Called after every tick, to show progress.

    Returns:
        What became of the run, and what was written.

    Raises:
        InputError: The folder is no good, or the scene.
        LeafError: A leaf raised an exception; the folder holds what was run until then.
        MachineError: An engine failed, and the folder holds what was run until then; or the disk is full or
            not writable.
        KeyboardInterrupt: The run was interrupted; the folder holds what was run until then.
    """
    with whole_folder(folder, FILES) as inside:
        recorder, camera = RunRecorder(runner, scenario), None
        if runner.options.rendering:
            how = film or Film()
            try:
                camera = VideoRecorder(inside / VIDEO, how.camera, size=how.size, every=how.every)
            except MachineError as error:
                no_video = f"No video: {error}."
        callbacks = [c for c in (recorder, camera, watch) if c is not None]

        def record(step: Step) -> None:
            for callback in callbacks:
                callback(step)

        end: KeyboardInterrupt | BtTasksimError | None = None
        try:
            with contextlib.nullcontext() if camera is None else camera:
                result = runner.run(seed, stream, record)
        except (KeyboardInterrupt, BtTasksimError) as stop:
            if len(recorder) < LEAST:
                raise
            failure = stop if isinstance(stop, BtTasksimError) else None
            end, camera = stop, None
            no_video = f"No video: the run {'was interrupted' if failure is None else 'broke off'}."
            result = runner.broken_off(len(recorder) - 1, failure)
        remarks = _fill(inside, result, recorder, camera, no_video)
    if end is not None:
        end.args = ("; ".join(filter(None, (str(end), f"what was run is in {folder}"))),)
        raise end
    paths = {name: Path(folder) / name for name in FILES if (Path(folder) / name).exists()}
    return result, RunFiles(Path(folder), paths, remarks)


def filming_runner(
    tree: Behaviour,
    scene: WorldSource,
    options: EngineOptions | None = None,
    longest: float = LONGEST,
) -> tuple[Runner, str]:
    """A runner that can draw; where this machine cannot, one that does not.

    Args:
        tree: The tree's root.
        scene: The scene.
        options: Which engines.
        longest: Seconds of an episode after which it is stopped.

    Returns:
        The runner, and one sentence that says why it cannot draw; empty where it can.

    Raises:
        InputError: Tree, scene or options are no good.
        MachineError: Another engine cannot start.
    """
    options = options or EngineOptions()
    try:
        return Runner(tree, scene, dataclasses.replace(options, rendering=True), longest=longest), ""
    except MachineError as error:
        without = Runner(tree, scene, dataclasses.replace(options, rendering=False), longest=longest)
        return without, f"No video: {error}."


def _fill(
    inside: Path, result: Result, recorder: RunRecorder, film: VideoRecorder | None, no_video: str
) -> tuple[str, ...]:
    """Write all files but the video; returns remarks on those that cannot be."""
    tree = recorder.runner.tree
    remarks = [no_video] if film is None and no_video != NO_VIDEO else []
    video = None if film is None else Video(VIDEO, film.fps or 20.0)
    run = recorder.demonstration(result, video)
    text = json.dumps(about(result, recorder.runner, recorder.scenario), indent=2, allow_nan=False)
    write_text(inside / RESULT, text + "\n")
    write_text(inside / TREE, tree_svg(tree, recorder.last_statuses()))
    write_report(inside / REPORT, run, tree, None if film is None else inside / VIDEO, no_video)
    try:
        recorder.write(inside / LOG, result, video)
    except InputError as error:
        remarks.append(f"No {LOG}: {str(error).replace(str(inside / LOG), LOG)}.")
    return tuple(remarks)
