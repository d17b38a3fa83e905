"""Whether it matters which of two objects is which."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.specs import Goal


def told_apart(configuration: ActorConfiguration, a: str, b: str) -> bool:
    """Whether a world tells two objects apart by name: by its goals, or by what happens to one of them.

    A world without goals may have a tree that names any of them; functions in Python do, too.
    """
    disturbed = configuration.disturbance is not None and configuration.disturbance.object in (a, b)
    if not configuration.goals or configuration.functions or disturbed:
        return True
    return Counter(configuration.goals) != Counter(_exchanged(configuration.goals, a, b))


def _exchanged(goals: Sequence[Goal], a: str, b: str) -> list[Goal]:
    """The same goals, with two objects' names exchanged."""
    other = {a: b, b: a}
    return [
        replace(goal, object=other.get(goal.object, goal.object), place=other.get(goal.place, goal.place))
        for goal in goals
    ]
