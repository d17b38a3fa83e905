"""Environments that `gymnasium.make` knows by name."""

from __future__ import annotations

from typing import Any

from bt_tasksim.engines.registry import EngineOptions
from bt_tasksim.scene import ObjectSpec
from bt_tasksim.training.episode import EpisodeEnv


def grasp_then_pick(
    robot: str = "panda",
    target: ObjectSpec | None = None,
    lesson: int | None = -1,
    noise: str = "original",
    render_mode: str | None = None,
    **settings: Any,
) -> EpisodeEnv:
    """A grasp that is judged by the pick after it, see `trees.scenarios.grasp_then_pick`.

    Args:
        robot: Name of a bundled robot, or path of a data file.
        target: What the object may be; by default what the lesson says.
        lesson: Number of the scene's lesson, negative from the last one; None: the held-apart draws. Not
            looked at where ``target`` is given.
        noise: Noise model of the estimate, where the lesson names none.
        render_mode: ``rgb_array``, or None.
        settings: Further arguments of `EpisodeEnv`.
    """
    import dataclasses

    from trees.scenarios import grasp_then_pick as scenario

    scene = scenario.scene(robot)
    if target is not None:
        scene, lesson = dataclasses.replace(scene, objects={"target": target}, lessons=()), None
    elif lesson is not None and lesson < 0:
        lesson += len(scene.lessons)
    options = EngineOptions(noise=noise, rendering=render_mode is not None)
    return EpisodeEnv(
        scenario.build(), scene, options=options, lesson=lesson, render_mode=render_mode, **settings
    )
