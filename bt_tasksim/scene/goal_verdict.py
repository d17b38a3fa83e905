"""What becomes of one goal: its relation, and that its object is at rest and let go."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bt_tasksim.core.bundles import mapped
from bt_tasksim.core.outcomes import Outcome, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.units import METRES_PER_SECOND, RADIANS_PER_SECOND
from bt_tasksim.scene.goal_functions import GoalFunction
from bt_tasksim.scene.looked_at import WatchedState
from bt_tasksim.scene.relations import FinalState, relation_named
from bt_tasksim.scene.specs import Goal

AT_REST = (0.01, 0.1)
"""Speeds in m/s and rad/s below which an object is at rest."""

NOT_AT_REST = register_reason(
    "not_at_rest",
    "{object} still moves at {speed} and {turning}",
    speed=METRES_PER_SECOND,
    turning=RADIANS_PER_SECOND,
)
HAND_NOT_CLEAR = register_reason("hand_not_clear", "the hand still touches {object}")
FUNCTION_TRUE = register_reason("function_true", "{goal}: {words}")
FUNCTION_FALSE = register_reason("function_false", "{goal}: {words}")
FUNCTION_NOT_HERE = register_reason(
    "function_not_here", "the goal '{goal}' was not judged: it is a function, and only its name is known here"
)


@dataclass(frozen=True)
class GoalVerdict:
    """What became of one goal.

    Attributes:
        goal: The goal in words, such as ``cup on lower_board``.
        when: ``end``, ``once`` or ``kept``, see `Goal`.
        reached: It is reached; None where it could not be judged.
        outcome: How it is, or the first thing that is wrong.
        position_error: Metres from where the object should be; NaN where the goal does not say so.
        angle_error: Radians from how it should be; NaN likewise.
        time: Seconds at which a goal that has to be true once, or for a while, was first seen to have been;
            else NaN.
        objects: The objects that it is about, which so may be moved.
    """

    goal: str
    when: str
    reached: bool | None
    outcome: Outcome
    position_error: float = math.nan
    angle_error: float = math.nan
    time: float = math.nan
    objects: frozenset[str] = frozenset()

    def to_data(self) -> dict[str, Any]:
        """As plain data, for files; what is not known is None."""
        numbers = {
            "position_error": self.position_error,
            "angle_error": self.angle_error,
            "time": self.time,
        }
        return {
            "goal": self.goal,
            "when": self.when,
            "reached": self.reached,
            "reason": "" if self.reached else self.outcome.cause.reason.name,
            "why": self.outcome.sentence,
            **{name: value if math.isfinite(value) else None for name, value in numbers.items()},
        }


def judge_goal(goal: Goal, final: FinalState) -> GoalVerdict:
    """Whether a goal is reached in a state."""
    relation = relation_named(goal.relation)
    placement = relation.evaluate(goal, final)
    wrong = None if placement.reached else placement.outcome
    if wrong is None and not (relation.in_hand or relation.may_be_held):
        wrong = _not_left_alone(goal.object, final)
    return GoalVerdict(
        str(goal),
        goal.when,
        wrong is None,
        wrong or placement.outcome,
        placement.position_error,
        placement.angle_error,
        objects=frozenset({goal.object}),
    )


def judge_function(goal: GoalFunction, final: FinalState) -> GoalVerdict:
    """Whether a function says that it is reached. It is about what it looks at.

    Raises:
        InputError: See `GoalFunction.ask`.
    """
    watched = WatchedState.of(_for_reading(final))
    answer = goal.ask(watched)
    if answer is None:
        everything = frozenset(final.world.index)
        return GoalVerdict(goal.name, "end", None, FUNCTION_NOT_HERE(goal=goal.name), objects=everything)
    reached, words = answer
    reason = FUNCTION_TRUE if reached else FUNCTION_FALSE
    said = words or ("it is reached" if reached else "it is not reached")
    outcome = reason(goal=goal.name, words=said)
    return GoalVerdict(goal.name, "end", reached, outcome, objects=frozenset(watched.names))


def _for_reading(final: FinalState) -> FinalState:
    """The same state, in arrays that cannot be written: no function changes what the next one is given."""

    def still(values: Array) -> Array:
        copied = np.array(values)
        copied.setflags(write=False)
        return copied

    return replace(final, hidden=mapped(still, final.hidden))


def _not_left_alone(name: str, final: FinalState) -> Outcome | None:
    velocity = final.hidden.velocities[final.world.object_index(name)]
    speed, turning = (float(np.linalg.norm(v)) for v in np.split(velocity, 2))
    if speed > AT_REST[0] or turning > AT_REST[1]:
        return NOT_AT_REST(object=name, speed=speed, turning=turning)
    return HAND_NOT_CLEAR(object=name) if final.touched(name) else None
