"""Whether goals that set a part of furniture to a value ask for anything: some are reached before a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.checking.report import WARNING, Report
from bt_tasksim.core.joints import Joints
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.joint_laws import shut
from bt_tasksim.scene.relations import relation_named
from bt_tasksim.scene.relations.joint_goals import SetTo
from bt_tasksim.scene.specs import Goal

if TYPE_CHECKING:
    from bt_tasksim.scene.scene import Scene

MOST = 0.5
"""Share of the draws up to which a part may start where it is wanted: where it starts may be drawn."""
REMEDY = "give it a smaller tolerance, or another value"


def check_part_goals(scene: Scene, worlds: Sequence[ActorConfiguration], report: Report) -> None:
    """No goal ``set`` is mostly reached where its part starts, or where it is shut and should be open.

    Args:
        scene: The scene.
        worlds: Draws of it.
        report: Where findings go.
    """
    for number, goal in enumerate(worlds[0].goals):
        if goal.when == "kept" or not isinstance(relation_named(goal.relation), SetTo):
            continue
        each = [_reached(world.goals[number], world) for world in worlds]
        where = f"goal of '{goal.object}'"
        if (often := sum(start for start, _ in each)) > MOST * len(worlds):
            what = f"is reached before the run in {often} of {len(worlds)} draws: it starts there"
            report.add(WARNING, scene.name, where, what, REMEDY)
        if often := sum(end for _, end in each):
            what = f"is reached with '{goal.object}' shut in {often} of {len(worlds)} draws"
            report.add(WARNING, scene.name, where, what, REMEDY)


def _reached(goal: Goal, world: ActorConfiguration) -> tuple[bool, bool]:
    """It is reached where its part starts; and where that is shut, though it asks for another value."""
    actor = next(actor for actor in world.objects if actor.name == goal.object)
    relation, joint = relation_named(goal.relation), actor.joint
    if joint is None or not isinstance(relation, SetTo) or goal.value is None:
        return False, False
    limits, turns = np.array([joint.limits]), np.array([joint.turns])
    start = Joints.of([joint]).value(np.array([actor.pose]))
    so = relation.asked(goal, joint, np.array([start[0], joint.limits[0]])).so
    asks_shut = bool(shut(np.array([goal.value]), limits, turns).so[0])
    return bool(so[0]), bool(so[1]) and not asks_shut
