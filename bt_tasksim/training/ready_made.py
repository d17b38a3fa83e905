"""Environments that `gymnasium.make` knows by name."""

from __future__ import annotations

from typing import Any

from bt_tasksim.core.renamed import renamed_arguments
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.scene.specs import ObjectSpec
from bt_tasksim.training.env import EpisodeEnv


@renamed_arguments(lesson="stage")
def grasp_then_pick(
    robot: str = "panda",
    target: ObjectSpec | None = None,
    stage: int | None = -1,
    noise: str = "original",
    render_mode: str | None = None,
    **settings: Any,
) -> EpisodeEnv:
    """A grasp that is judged by the pick after it, see `trees.scenarios.grasp_then_pick`.

    Args:
        robot: Name of a bundled robot, or path of a data file.
        target: What the object may be; by default what the stage says.
        stage: Number of the scene's stage, negative from the last one; None: the held-apart draws. Not
            looked at where ``target`` is given.
        noise: Noise model of the estimate, where the stage names none.
        render_mode: ``rgb_array``, or None.
        settings: Further arguments of `EpisodeEnv`.
    """
    import dataclasses

    from bt_tasksim.trees.scenarios import grasp_then_pick as scenario

    scene = scenario.scene(robot)
    if target is not None:
        scene, stage = dataclasses.replace(scene, objects={"target": target}, stages=()), None
    elif stage is not None and stage < 0:
        stage += len(scene.stages)
    options = EngineOptions(noise=noise, rendering=render_mode is not None)
    return EpisodeEnv(
        scenario.build(), scene, options=options, stage=stage, render_mode=render_mode, **settings
    )
