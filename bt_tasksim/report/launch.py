"""One call to run a tree, with or without a video, and with or without a folder that keeps the run."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from py_trees.behaviour import Behaviour

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.files import check_folder, check_writable, write_bytes
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.result import Result
from bt_tasksim.execution.runner import Runner
from bt_tasksim.execution.session import engine_options
from bt_tasksim.report.video import Film, VideoRecorder
from bt_tasksim.report.write import FILES, VIDEO, write_run
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.trees.load import with_policies

_OPTIONS = ("seed", "video", "out", "film", "policy", "options")
"""What `run` takes by keyword besides."""
_log = logging.getLogger(__name__)


def run(
    tree: Behaviour,
    scene: WorldSource | None = None,
    seed: int = 0,
    *,
    video: str | Path | bool | None = None,
    out: str | Path | None = None,
    film: Film | None = None,
    policy: Mapping[str, str] | None = None,
    options: EngineOptions | None = None,
    **engines: Any,
) -> Result:
    """Run a tree once in a scene.

    Args:
        tree: The tree's root.
        scene: The scene; None for the world that the engines bring.
        seed: Seed of the draw.
        video: Path of a video to write; or True, for ``run.mp4`` in the folder ``out``.
        out: Folder that keeps the run, as ``bt-tasksim run --out`` does: result, log, picture of the tree and
            report, all of them or none. An earlier run's folder is replaced, any other that is not empty is
            refused. None: nothing is kept.
        film: How a video is made: camera, size, frames a second.
        policy: Policies by concept, such as ``{"grasp": "policies/grasp"}``: every leaf of the concept takes
            it, whatever the tree says, and keeps it. ``"programmed"``, or a policy's name or folder.
        options: Which engines; or name them by keyword, such as ``noise="none"``, ``perception="camera"``.
        **engines: See `EngineOptions`.

    Returns:
        What became of it; ``result.status`` and ``result.why`` say it in short.

    Raises:
        InputError: The tree, the scene, a policy, an option, or a place to write to is no good.
        MachineError: An engine failed, the machine cannot film, or the disk is full or not writable.
        KeyboardInterrupt: The run was interrupted; the folder, if any, holds what was run until then.
    """
    options = engine_options(options, engines, _OPTIONS)
    film, path = film or Film(), None if isinstance(video, bool) or video is None else Path(video)
    if video is True and out is None:
        raise InputError("video=True films into the run's folder: give out=FOLDER, or video='run.mp4'")
    recorder = None if path is None else VideoRecorder(path, film.camera, size=film.size, every=film.every)
    if path is not None:
        check_writable(path)
    if out is not None:
        check_folder(out, FILES)
    filmed = path is not None or video is True
    if filmed:
        options = dataclasses.replace(options, rendering=True)
    runner = Runner(with_policies(lambda: tree, (policy or {}).items())(), scene, options)
    try:
        if out is not None:
            return _kept(Path(out), runner, seed, path, film)
        if recorder is None:
            return runner.run(seed)
        with recorder:
            return runner.run(seed, record=recorder)
    finally:
        runner.close()


def _kept(folder: Path, runner: Runner, seed: int, video: Path | None, film: Film) -> Result:
    """A run whose folder is written, and whose video lies in another place too."""
    result, files = write_run(folder, runner, seed, film=film)
    for remark in files.remarks:
        _log.warning(remark)
    if video is not None:
        if VIDEO not in files.paths:
            raise MachineError(f"there is no video for '{video}'; the rest of the run is in '{folder}'")
        write_bytes(video, files.paths[VIDEO].read_bytes())
    return result
