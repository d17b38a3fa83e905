"""A run's folder: everything that is left of a run, written whole or not at all."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from py_trees.behaviour import Behaviour

from bt_tasksim.engines.registry import EngineOptions
from bt_tasksim.errors import InputError, MachineError
from bt_tasksim.files import whole_folder, write_text
from bt_tasksim.report.report import NO_VIDEO, write_report
from bt_tasksim.report.run_log import RunRecorder, about
from bt_tasksim.report.tree_picture import tree_svg
from bt_tasksim.report.video import VideoRecorder
from bt_tasksim.runner import Result, Runner, Step
from bt_tasksim.scene import Scene
from demos_decomp.log import Video

RESULT, LOG, TREE, VIDEO, REPORT = "result.json", "run.h5", "tree.svg", "run.mp4", "report.html"
FILES = (RESULT, LOG, TREE, VIDEO, REPORT)
"""Names of the files in a run's folder, which a later run may replace."""


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


def run_to_folder(
    tree: Behaviour,
    scene: Scene,
    folder: str | Path,
    seed: int = 0,
    options: EngineOptions | None = None,
    *,
    video: bool = True,
    every: int = 2,
    scenario: str = "",
    stream: str = "evaluation",
    watch: Callable[[Step], None] | None = None,
) -> tuple[Result, RunFiles]:
    """Run a tree once and keep everything of it in a folder.

    Args:
        tree: The tree's root.
        scene: The scene.
        folder: Where to; an existing folder is replaced if it holds nothing but a run's files.
        seed: Seed of the draw.
        options: Which engines.
        video: Film the run. Where nothing can be drawn the run goes on without, and a remark says why.
        every: Draw every so many ticks.
        scenario: What is run: a scenario's name or the tree's file.
        stream: Stream of draws.
        watch: Called after every tick, to show progress.

    Returns:
        What became of the run, and what was written.

    Raises:
        InputError: Tree, scene, options or folder are no good.
        MachineError: An engine failed, or the disk is full or not writable.
    """
    with whole_folder(folder, FILES) as inside:
        runner, no_video = _runner(tree, scene, options or EngineOptions(), video)
        assert runner.pipeline is not None
        recorder = RunRecorder(runner, scenario)
        film: VideoRecorder | None = None
        if not no_video:
            try:
                film = VideoRecorder(inside / VIDEO, every=every)
            except MachineError as error:
                no_video = f"No video: {error}."
        callbacks = [c for c in (recorder, film, watch) if c is not None]

        def record(step: Step) -> None:
            for callback in callbacks:
                callback(step)

        try:
            with contextlib.nullcontext() if film is None else film:
                result = runner.run(seed, stream, record)
        finally:
            runner.pipeline.close()
        shot = None if film is None else inside / VIDEO
        remarks = _fill(inside, result, recorder, shot, film.fps if film is not None else None, no_video)
    return result, _files(Path(folder), remarks)


def write_run(
    folder: str | Path,
    result: Result,
    recorder: RunRecorder,
    video: str | Path | None = None,
    fps: float | None = None,
    no_video: str = NO_VIDEO,
) -> RunFiles:
    """Write the folder of a run that has been recorded.

    Args:
        folder: Where to; an existing folder is replaced if it holds nothing but a run's files.
        result: What the run gave.
        recorder: What was recorded.
        video: A video of it, to be copied; of a `VideoRecorder`.
        fps: The video's frames a second.
        no_video: One sentence for the report: why there is no video.

    Raises:
        InputError: The folder is no good, or the video is missing.
        MachineError: The disk is full or not writable.
    """
    with whole_folder(folder, FILES) as inside:
        if video is not None:
            if not Path(video).is_file():
                raise InputError(f"there is no video '{video}'")
            shutil.copyfile(video, inside / VIDEO)
        shot = None if video is None else inside / VIDEO
        remarks = _fill(inside, result, recorder, shot, fps, no_video)
    return _files(Path(folder), remarks)


def _runner(tree: Behaviour, scene: Scene, options: EngineOptions, video: bool) -> tuple[Runner, str]:
    """A runner, and why nothing can be drawn; empty where it can."""
    if not video:
        return Runner(tree, scene, options), NO_VIDEO
    try:
        return Runner(tree, scene, dataclasses.replace(options, rendering=True)), ""
    except MachineError as error:
        if options.perception == "camera":
            raise
        without = Runner(tree, scene, dataclasses.replace(options, rendering=False))
        return without, f"No video: {error}."


def _fill(
    inside: Path,
    result: Result,
    recorder: RunRecorder,
    video: Path | None,
    fps: float | None,
    no_video: str,
) -> tuple[str, ...]:
    """Write all files but the video; returns remarks on those that cannot be."""
    tree = recorder.runner.tree
    remarks = [no_video] if video is None and no_video != NO_VIDEO else []
    run = recorder.demonstration(result, None if video is None else Video(video.name, fps or 20.0))
    text = json.dumps(about(result, recorder.runner, recorder.scenario), indent=2, allow_nan=False)
    write_text(inside / RESULT, text + "\n")
    write_text(inside / TREE, tree_svg(tree, recorder.last_statuses()))
    write_report(inside / REPORT, run, tree, video, no_video)
    try:
        recorder.write(inside / LOG, result, run.video)
    except InputError as error:
        reason = str(error).replace(f"'{inside / LOG}'", LOG)
        remarks.append(f"No {LOG}: {reason}.")
    return tuple(remarks)


def _files(folder: Path, remarks: tuple[str, ...]) -> RunFiles:
    return RunFiles(folder, {n: folder / n for n in FILES if (folder / n).exists()}, remarks)
