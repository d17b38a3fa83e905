"""Whether things stay where they stand, by physics alone: at the start, and as the goals ask."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bt_tasksim import EngineOptions, load_robot, poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Command
from bt_tasksim.execution.pipelines import build_pipeline
from bt_tasksim.scene.configuration import ActorConfiguration

TIME = 2.0
"""Seconds for which nobody touches anything."""
MOVED = (0.015, float(np.deg2rad(8.0)))
"""Metres and radians by which a thing may settle."""


def fallen(configuration: ActorConfiguration, placed: Mapping[str, Array]) -> str:
    """Name of a thing that does not stay where it is; empty where all do.

    Args:
        configuration: The world as drawn.
        placed: Poses ``(7,)`` of objects that stand elsewhere than they were drawn, by name.
    """
    moved = [
        replace(actor, pose=tuple(np.asarray(placed.get(actor.name, actor.pose), float).tolist()))
        for actor in configuration.objects
    ]
    asked = replace(configuration, objects=tuple(moved))
    robot = load_robot(configuration.robot)
    world = asked.world_model([tip.name for tip in robot.tips], robot.opening)
    pipeline = build_pipeline(robot, EngineOptions())
    try:
        pipeline.reset(asked, world)
        for _ in range(round(TIME * asked.control_frequency)):
            pipeline.step(Command())
        hidden = pipeline.hidden()
        assert hidden is not None
        for actor in moved:
            before, now = np.array(actor.pose), hidden.objects[world.object_index(actor.name)]
            shift = float(np.linalg.norm(now[:3] - before[:3]))
            if shift > MOVED[0] or float(poses.tilt(now[3:], before[3:])) > MOVED[1]:
                return actor.name
        return ""
    finally:
        pipeline.close()
