"""Environments that `gymnasium.make` and `gymnasium.make_vec` know by name."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

from bt_tasksim.core.renamed import renamed_arguments
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import ObjectSpec
from bt_tasksim.training.env import EpisodeEnv
from bt_tasksim.training.vector_env import EpisodeVectorEnv


class _Worlds(NamedTuple):
    """Where episodes are drawn from: a scene, and the number of its stage or None."""

    scene: Scene
    stage: int | None


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
    from bt_tasksim.trees.scenarios.grasp_then_pick import build

    worlds = _grasps(robot, target, stage)
    options = EngineOptions(noise=noise, rendering=render_mode is not None)
    return EpisodeEnv(
        build(), worlds.scene, options=options, stage=worlds.stage, render_mode=render_mode, **settings
    )


@renamed_arguments(lesson="stage")
def grasp_then_pick_worlds(
    num_envs: int = 1,
    robot: str = "panda",
    target: ObjectSpec | None = None,
    stage: int | None = -1,
    noise: str = "original",
    **settings: Any,
) -> EpisodeVectorEnv:
    """`grasp_then_pick` in many worlds of one process.

    Args:
        num_envs: How many worlds.
        robot: See `grasp_then_pick`.
        target: See there.
        stage: See there.
        noise: See there.
        settings: Further arguments of `EpisodeVectorEnv`.
    """
    from bt_tasksim.trees.scenarios.grasp_then_pick import build

    worlds = _grasps(robot, target, stage)
    options = EngineOptions(noise=noise)
    return EpisodeVectorEnv(build(), worlds.scene, num_envs, options=options, stage=worlds.stage, **settings)


def _grasps(robot: str, target: ObjectSpec | None, stage: int | None) -> _Worlds:
    from bt_tasksim.trees.scenarios.grasp_then_pick import scene

    found = scene(robot)
    if target is not None:
        return _Worlds(dataclasses.replace(found, objects={"target": target}, stages=()), None)
    return _Worlds(found, stage if stage is None or stage >= 0 else stage + len(found.stages))
