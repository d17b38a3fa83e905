"""One call to run a tree, with or without a video."""

from __future__ import annotations

from typing import Any

from py_trees.behaviour import Behaviour

from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.result import Result
from bt_tasksim.execution.runner import Runner
from bt_tasksim.report.video import VideoRecorder
from bt_tasksim.scene.scene import Scene


def run(
    tree: Behaviour,
    scene: Scene,
    seed: int = 0,
    *,
    video: str | None = None,
    options: EngineOptions | None = None,
    **engines: Any,
) -> Result:
    """Run a tree once in a scene.

    Args:
        tree: The tree's root.
        scene: The scene.
        seed: Seed of the draw.
        video: Path of a video to write.
        options: Which engines; or name them by keyword, such as ``noise="none"``, ``perception="camera"``.
        **engines: See `EngineOptions`.

    Returns:
        What became of it; ``result.status`` and ``result.why`` say it in short.
    """
    if options is None:
        options = EngineOptions(**({"rendering": video is not None} | engines))
    runner = Runner(tree, scene, options)
    try:
        if video is None:
            return runner.run(seed)
        with VideoRecorder(video) as recorder:
            return runner.run(seed, record=recorder)
    finally:
        runner.pipeline.close()
