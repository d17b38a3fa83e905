"""What physics makes of things that nobody touches: as they begin, and where an arm has left them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from bt_tasksim import EngineOptions, load_robot, poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Command, Hidden, WorldModel
from bt_tasksim.execution.pipelines import build_pipeline
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.relations import FinalState
from bt_tasksim.scene.success import Verdict, evaluate_success, knocked_over

TIME = 2.0
"""Seconds for which nobody touches anything."""
PARKED = poses.pose([0.0, 0.0, 50.0])
"""Where things wait that are not let go yet: they fall, far from all others."""
APART = 5.0
"""Metres between those."""


def settled(configuration: ActorConfiguration, placed: Mapping[str, Array]) -> Hidden:
    """The physics state, once things have settled.

    Args:
        configuration: The world as drawn.
        placed: Poses ``(7,)`` of objects that are elsewhere than they were drawn, by name.
    """
    moved = [
        replace(actor, pose=tuple(np.asarray(placed.get(actor.name, actor.pose), float).tolist()))
        for actor in configuration.objects
    ]
    asked = replace(configuration, objects=tuple(moved))
    pipeline = build_pipeline(load_robot(configuration.robot), EngineOptions())
    try:
        pipeline.reset(asked, _world(asked))
        for _ in range(round(TIME * asked.control_frequency)):
            pipeline.step(Command())
        hidden = pipeline.hidden()
        assert hidden is not None
        return hidden
    finally:
        pipeline.close()


def poses_in(configuration: ActorConfiguration, hidden: Hidden) -> dict[str, Array]:
    """Pose ``(7,)`` of each object in a physics state, by name."""
    return {
        actor.name: np.array(pose) for actor, pose in zip(configuration.objects, hidden.objects, strict=False)
    }


def overturned(configuration: ActorConfiguration, hidden: Hidden) -> str:
    """What does not stay where it begins, though no goal is about it, so that every run is a failure.

    Empty where all do. What has a goal may begin by falling: it can be taken from where it lies.
    """
    meant = {goal.object for goal in configuration.goals}
    final = FinalState(configuration, _world(configuration), hidden)
    return next((outcome.sentence for outcome in knocked_over(meant, final)), "")


def verdict(
    configuration: ActorConfiguration, placed: Mapping[str, Array], dropped: Sequence[tuple[str, Array]]
) -> Verdict:
    """What the judge of every run says of what an arm has left, once it has settled.

    Args:
        configuration: The world as drawn, with its goals.
        placed: Poses ``(7,)`` of objects that were put down or stand where they were, by name.
        dropped: Name and pose ``(7,)`` of those that were let go in the air, one after the other.
    """
    now = dict(placed)
    waiting = [name for name, _ in dropped]
    for k, name in enumerate(waiting):
        now[name] = poses.shifted(PARKED, np.array([100.0 + APART * k, 0.0, 0.0]))
    hidden = None if dropped else settled(configuration, now)
    for name, pose in dropped:
        waiting.remove(name)
        hidden = settled(configuration, {**now, name: pose})
        found = poses_in(configuration, hidden)
        now |= {other: pose for other, pose in found.items() if other not in waiting}
    assert hidden is not None
    # What is put down by geometry may begin by a hair in what bears it, which no arm could do.
    apart = replace(hidden, penetration=np.zeros_like(hidden.penetration))
    return evaluate_success(configuration, _world(configuration), apart)


def _world(configuration: ActorConfiguration) -> WorldModel:
    robot = load_robot(configuration.robot)
    return configuration.world_model([tip.name for tip in robot.tips], robot.opening)
