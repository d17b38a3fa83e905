"""The success evaluator: whether a run did what the scene's goals ask, as the physics state tells it.

Nothing here looks at the tree, its statuses or its estimates. What each relation asks of an object stands in
`bt_tasksim.scene.relations`, what every goal asks in `bt_tasksim.scene.goal_verdict`; what every run must
keep to stands here.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Outcome, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.units import COUNT, METRES, RADIANS, SECONDS
from bt_tasksim.core.world import Hidden, WorldModel
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.goal_verdict import (
    AT_REST,
    FUNCTION_NOT_HERE,
    HAND_NOT_CLEAR,
    NOT_AT_REST,
    GoalVerdict,
    judge_function,
    judge_goal,
)
from bt_tasksim.scene.moments import Moments
from bt_tasksim.scene.relations import FinalState

__all__ = [
    "AT_REST",
    "DEEPEST",
    "GOALS_MISSED",
    "GOALS_REACHED",
    "HAND_NOT_CLEAR",
    "KNOCKED",
    "KNOCKED_OVER",
    "NEVER",
    "NOT_AT_REST",
    "NOT_KEPT",
    "NO_GOAL",
    "PENETRATION",
    "GoalVerdict",
    "Overlap",
    "Verdict",
    "at_rest",
    "evaluate_success",
    "knocked_over",
    "penetration",
]

DEEPEST = 0.002
"""Metres of overlap of two bodies that may not be exceeded at any time of a run."""
KNOCKED = (0.05, math.radians(15.0))
"""Metres and radians by which another object may be shifted or tilted."""

NO_GOAL = register_reason(
    "no_goal", "no goal is set for this scene, so the tree's own word was taken and nothing was judged"
)
GOALS_REACHED = register_reason("goals_reached", "all {count:.0f} goals are reached: {said}", count=COUNT)
NEVER = register_reason("never", "at no moment of the run, and in the end")
NOT_KEPT = register_reason(
    "not_kept",
    "{goal} for {value} without a break at most, and not for {limit}",
    value=SECONDS,
    limit=SECONDS,
)
KNOCKED_OVER = register_reason(
    "knocked_over", "{object} was shifted by {shift} and tilted by {tilt:.0f}", shift=METRES, tilt=RADIANS
)
PENETRATION = register_reason("penetration", "{bodies} overlapped by {depth:.1f}{moment}", depth=METRES)
GOALS_MISSED = register_reason("goals_missed", "{missed} of {count} goals are not reached ({goals})")
"""Where it is more than one; the first one's reason stands behind it."""
NAMED = 5
"""Goals that are named; of more it is said how many."""
Overlap = tuple[str, str, float, float]
"""Names of two bodies, metres, and the seconds at which they overlapped so."""


@dataclass(frozen=True)
class Verdict:
    """What became of a run.

    Attributes:
        success: Everything asked for is true.
        outcome: How the objects are at the end, or the first thing that is wrong.
        position_error: Metres from where the object should be, the largest of all goals; NaN where no goal
            says so.
        angle_error: Radians from how it should be, up to its symmetry; likewise.
        penetration: Deepest overlap of two bodies during the run, metres.
        placements: What became of each goal.
    """

    success: bool
    outcome: Outcome
    position_error: float
    angle_error: float
    penetration: float
    placements: tuple[GoalVerdict, ...] = ()

    @property
    def judged(self) -> bool:
        """It says more than the tree's own word: there was a goal, and each could be judged."""
        return not (self.outcome.is_a(NO_GOAL) or self.outcome.is_a(FUNCTION_NOT_HERE))

    @property
    def reason(self) -> str:
        """The registered name of the reason for failure; empty on success."""
        return "" if self.success else self.outcome.cause.reason.name

    @property
    def why(self) -> str:
        """One sentence with numbers."""
        return self.outcome.sentence

    def to_data(self) -> dict[str, Any]:
        """As plain data, for files; what no goal asks for is None."""
        errors = {
            "position_error": self.position_error,
            "angle_error": self.angle_error,
            "penetration": self.penetration,
        }
        return {
            "success": self.success,
            "judged": self.judged,
            "reason": self.reason,
            "why": self.why,
            **{name: value if math.isfinite(value) else None for name, value in errors.items()},
            "placements": [placement.to_data() for placement in self.placements],
        }


def evaluate_success(
    configuration: ActorConfiguration,
    world: WorldModel,
    hidden: Hidden,
    moments: Moments | None = None,
    overlap: Overlap | None = None,
) -> Verdict:
    """Judge the state at the end of a run.

    Args:
        configuration: The world as it was drawn, with its goals.
        world: Names and facts.
        hidden: The physics state at the end.
        moments: What was seen of goals that have to be true once, or for a while; None where nobody looked:
            then they are judged at the end alone.
        overlap: The two bodies that overlapped most; None where the engine does not say it.

    Raises:
        InputError: A goal that is a function raised an exception, or answered nonsense.
    """
    depth = float(hidden.penetration)
    final = FinalState(configuration, world, hidden)
    placements = (*_goals(final, moments), *(judge_function(f, final) for f in configuration.functions))
    if not placements:
        return Verdict(True, NO_GOAL(), math.nan, math.nan, depth)
    wrong = next(_wrong(placements, final, overlap), None)
    return Verdict(
        wrong is None,
        wrong or _reached(placements),
        _largest([placement.position_error for placement in placements]),
        _largest([placement.angle_error for placement in placements]),
        depth,
        placements,
    )


def _goals(final: FinalState, moments: Moments | None) -> Iterator[GoalVerdict]:
    for goal in final.configuration.goals:
        before = None if moments is None else moments.found(goal)
        now = judge_goal(goal, final) if before is None else before
        if goal.when == "once" and not now.reached:
            now = dataclasses.replace(now, outcome=NEVER(now.outcome))
        if goal.when == "kept" and before is None and moments is not None:
            lasted = NOT_KEPT(goal=str(goal), value=moments.longest(goal), limit=goal.duration)
            now = dataclasses.replace(now, reached=False, outcome=lasted)
        yield now


def _reached(placements: Sequence[GoalVerdict]) -> Outcome:
    """What to say where nothing is wrong."""
    unknown = next((p.outcome for p in placements if p.reached is None), None)
    if unknown is not None:
        return unknown
    if len(placements) == 1:
        return placements[0].outcome
    said = "; ".join(placement.outcome.sentence for placement in placements)
    return GOALS_REACHED(count=len(placements), said=said)


def _wrong(
    placements: Sequence[GoalVerdict], final: FinalState, overlap: Overlap | None
) -> Iterator[Outcome]:
    """What is wrong, the first thing first."""
    missed = [placement for placement in placements if placement.reached is False]
    if len(missed) == 1:
        yield missed[0].outcome
    elif missed:
        more = [f"and {len(missed) - NAMED} more"] if len(missed) > NAMED else []
        named = ", ".join([*(placement.goal for placement in missed[:NAMED]), *more])
        yield GOALS_MISSED(missed[0].outcome, missed=len(missed), count=len(placements), goals=named)
    yield from knocked_over(frozenset().union(*(placement.objects for placement in placements)), final)
    if float(final.hidden.penetration) > DEEPEST:
        yield penetration(final.hidden.penetration, overlap)


def penetration(depth: Array | float, overlap: Overlap | None = None) -> Outcome:
    """That bodies overlapped too deeply, by name where it is known which.

    Args:
        depth: Metres.
        overlap: The two that overlapped most, and when.
    """
    if overlap is None:
        return PENETRATION(bodies="two bodies", depth=depth, moment="")
    one, two, _, time = overlap
    return PENETRATION(bodies=f"{one} and {two}", depth=depth, moment=f" at {time:.2f} s")


def knocked_over(meant: Collection[str], final: FinalState) -> Iterator[Outcome]:
    """Objects that were moved, though no goal is about them.

    What stood on an object, or in it, is carried along: it is looked at from there.

    Args:
        meant: Names of the objects that goals are about.
        final: The physics state, and where everything began.
    """
    for actor in final.configuration.objects:
        if actor.name in meant or actor.movable:
            continue
        before, now = final.start(actor.name), final.pose(actor.name)
        if actor.base:
            before, now = (
                poses.multiply(poses.inverse(base), pose)
                for base, pose in ((final.start(actor.base), before), (final.pose(actor.base), now))
            )
        shift = float(np.linalg.norm(now[:3] - before[:3]))
        tilted = abs(float(poses.tilt(now[3:]) - poses.tilt(before[3:])))
        if not (shift <= KNOCKED[0] and tilted <= KNOCKED[1]):
            yield KNOCKED_OVER(object=actor.name, shift=shift, tilt=tilted)


def _largest(errors: Sequence[float]) -> float:
    return max((error for error in errors if math.isfinite(error)), default=math.nan)


def at_rest(velocities: Array) -> Array:
    """Every object is at rest: boolean ``(...)``.

    Args:
        velocities: Of the objects ``(..., objects, 6)`` in m/s and rad/s; NaN where there is none.
    """
    fast, spins = (np.linalg.norm(v, axis=-1) for v in (velocities[..., :3], velocities[..., 3:]))
    found: Array = ~((fast >= AT_REST[0] / 2) | (spins >= AT_REST[1] / 2)).any(axis=-1)
    return found
