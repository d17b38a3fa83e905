"""Goals that have to be true in a run, once or for a while: they are asked after every control period."""

from __future__ import annotations

from dataclasses import replace

from bt_tasksim.core.world import Hidden, WorldModel
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.goal_verdict import GoalVerdict, judge_goal
from bt_tasksim.scene.relations import FinalState
from bt_tasksim.scene.specs import Goal

ROUNDING = 1e-6
"""Seconds by which sums of control periods may be wrong."""


class Moments:
    """Watches one run.

    Args:
        configuration: The world as drawn, with its goals.
        world: Names and facts.
    """

    def __init__(self, configuration: ActorConfiguration, world: WorldModel) -> None:
        self._configuration, self._world = configuration, world
        self._open = [goal for goal in configuration.goals if goal.when in ("once", "kept")]
        self._found: dict[Goal, GoalVerdict] = {}
        self._since: dict[Goal, float] = {}
        self._longest: dict[Goal, float] = {}

    @property
    def open(self) -> bool:
        """There is a goal that was not seen to be reached so far, and so there is something to look at."""
        return bool(self._open)

    def look(self, hidden: Hidden) -> None:
        """Look at the state of one moment."""
        final = FinalState(self._configuration, self._world, hidden)
        for goal in tuple(self._open):
            judged, now = judge_goal(goal, final), float(hidden.time)
            if not judged.reached:
                self._since.pop(goal, None)
                continue
            lasted = now - self._since.setdefault(goal, now)
            self._longest[goal] = max(lasted, self.longest(goal))
            if goal.when == "once" or lasted >= goal.duration - ROUNDING:
                self._found[goal] = replace(judged, time=now)
                self._open.remove(goal)

    def found(self, goal: Goal) -> GoalVerdict | None:
        """How a goal was when it was first reached; None where it never was."""
        return self._found.get(goal)

    def longest(self, goal: Goal) -> float:
        """For how long a goal has been true without a break, at most, seconds."""
        return self._longest.get(goal, 0.0)
