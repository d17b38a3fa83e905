"""Goals that have to be true at some moment of a run: they are asked after every control period."""

from __future__ import annotations

from dataclasses import replace

from bt_tasksim.core.world import Hidden, WorldModel
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.goal_verdict import GoalVerdict, judge_goal
from bt_tasksim.scene.relations import FinalState
from bt_tasksim.scene.specs import Goal


class Moments:
    """Watches one run.

    Args:
        configuration: The world as drawn, with its goals.
        world: Names and facts.
    """

    def __init__(self, configuration: ActorConfiguration, world: WorldModel) -> None:
        self._configuration, self._world = configuration, world
        self._open = [goal for goal in configuration.goals if goal.when == "once"]
        self._found: dict[Goal, GoalVerdict] = {}

    @property
    def open(self) -> bool:
        """There is a goal that was not seen to be true so far, and so there is something to look at."""
        return bool(self._open)

    def look(self, hidden: Hidden) -> None:
        """Look at the state of one moment."""
        final = FinalState(self._configuration, self._world, hidden)
        for goal in tuple(self._open):
            judged = judge_goal(goal, final)
            if judged.reached:
                self._found[goal] = replace(judged, time=float(hidden.time))
                self._open.remove(goal)

    def found(self, goal: Goal) -> GoalVerdict | None:
        """How a goal was when it was first true; None where it never was."""
        return self._found.get(goal)
