"""The success evaluator: whether a run did what the scene's goal asks, as the physics state tells it.

Nothing here looks at the tree, its statuses or its estimates. What each relation asks of an object stands in
`bt_tasksim.scene.relations`; what every run must keep to stands here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Outcome, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.units import METRES, METRES_PER_SECOND, RADIANS, RADIANS_PER_SECOND
from bt_tasksim.core.world import Hidden, WorldModel
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.relations import FinalState, relation_named
from bt_tasksim.scene.specs import Goal

AT_REST = (0.01, 0.1)
"""Speeds in m/s and rad/s below which an object is at rest."""
DEEPEST = 0.002
"""Metres of overlap of two bodies that may not be exceeded at any time of a run."""
KNOCKED = (0.05, math.radians(15.0))
"""Metres and radians by which another object may be shifted or tilted."""

NO_GOAL = register_reason("no_goal", "no goal is set for this scene")
NOT_AT_REST = register_reason(
    "not_at_rest",
    "{object} still moves at {speed} and {turning}",
    speed=METRES_PER_SECOND,
    turning=RADIANS_PER_SECOND,
)
HAND_NOT_CLEAR = register_reason("hand_not_clear", "the hand still touches {object}")
KNOCKED_OVER = register_reason(
    "knocked_over", "{object} was shifted by {shift} and tilted by {tilt:.0f}", shift=METRES, tilt=RADIANS
)
PENETRATION = register_reason("penetration", "two bodies overlapped by {depth:.1f}", depth=METRES)


@dataclass(frozen=True)
class Verdict:
    """What became of a run.

    Attributes:
        success: Everything asked for is true.
        outcome: How the object is at the end, or the first thing that is wrong.
        position_error: Metres from where the object should be; NaN where no goal says so.
        angle_error: Radians from how it should be, up to its symmetry; NaN likewise.
        penetration: Deepest overlap of two bodies during the run, metres.
    """

    success: bool
    outcome: Outcome
    position_error: float
    angle_error: float
    penetration: float

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
            "reason": self.reason,
            "why": self.why,
            **{name: value if math.isfinite(value) else None for name, value in errors.items()},
        }


def evaluate_success(configuration: ActorConfiguration, world: WorldModel, hidden: Hidden) -> Verdict:
    """Judge the state at the end of a run.

    Args:
        configuration: The world as it was drawn, with its goal.
        world: Names and facts.
        hidden: The physics state at the end.
    """
    goal, depth = configuration.goal, float(hidden.penetration)
    if goal is None:
        return Verdict(True, NO_GOAL(), math.nan, math.nan, depth)
    final = FinalState(configuration, world, hidden)
    relation = relation_named(goal.relation)
    placement = relation.evaluate(goal, final)
    wrong = None if placement.reached else placement.outcome
    if wrong is None:
        wrong = next(_wrong(goal, final, relation.in_hand), None)
    return Verdict(
        wrong is None, wrong or placement.outcome, placement.position_error, placement.angle_error, depth
    )


def _wrong(goal: Goal, final: FinalState, in_hand: bool) -> Iterator[Outcome]:
    """What is wrong besides the goal's own relation, the first thing first."""
    hidden = final.hidden
    if not in_hand:
        velocity = hidden.velocities[final.world.object_index(goal.object)]
        speed, turning = (float(np.linalg.norm(v)) for v in np.split(velocity, 2))
        if speed > AT_REST[0] or turning > AT_REST[1]:
            yield NOT_AT_REST(object=goal.object, speed=speed, turning=turning)
        if final.touched(goal.object):
            yield HAND_NOT_CLEAR(object=goal.object)
        yield from _knocked_over(goal, final)
    if float(hidden.penetration) > DEEPEST:
        yield PENETRATION(depth=hidden.penetration)


def _knocked_over(goal: Goal, final: FinalState) -> Iterator[Outcome]:
    for actor in final.configuration.objects:
        if actor.name == goal.object:
            continue
        before, now = final.start(actor.name), final.pose(actor.name)
        shift = float(np.linalg.norm(now[:3] - before[:3]))
        tilted = float(poses.tilt(now[3:]) - poses.tilt(before[3:]))
        if shift > KNOCKED[0] or tilted > KNOCKED[1]:
            yield KNOCKED_OVER(object=actor.name, shift=shift, tilt=tilted)


def at_rest(velocities: Array) -> Array:
    """Every object is at rest: boolean ``(...)``.

    Args:
        velocities: Of the objects ``(..., objects, 6)`` in m/s and rad/s; NaN where there is none.
    """
    fast, spins = (np.linalg.norm(v, axis=-1) for v in (velocities[..., :3], velocities[..., 3:]))
    found: Array = ~((fast >= AT_REST[0] / 2) | (spins >= AT_REST[1] / 2)).any(axis=-1)
    return found
