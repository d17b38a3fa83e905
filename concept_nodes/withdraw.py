"""Withdraw: open the hand, whatever is in it, and draw it back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Direction, Metres, MetresPerSecond, Newtons, Seconds
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.carry import miss
from bt_tasksim.concept_nodes.holding import REACH
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, force_at_wrist, strain
from bt_tasksim.concept_nodes.retreat import clear_retreat, retreat_path
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Statement, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, NEWTONS, SHARE
from bt_tasksim.core.world import Command
from bt_tasksim.planning.reference_motion import Path, at_times

WITHDRAWN = Form(
    "hand {opening} open, tool {distance} from its goal, {force} at the wrist",
    {"opening": SHARE, "distance": METRES, "force": NEWTONS},
)
NOT_BACK = register_reason(
    "not_drawn_back",
    "the tool is still {value} from where the hand was to draw back to, more than {limit}",
    value=METRES,
    limit=METRES,
)
PATIENCE = 1.0
"""Seconds after its path's end for which the tool may still be on its way."""
RELIEF = 0.4
"""Seconds after it has begun to draw back within which a hand that was pressed on before may still be."""


class WithdrawMemory(NamedTuple):
    """What a withdrawal remembers in ``N`` worlds.

    Attributes:
        path: Tool path away from where it began.
        start: Closure ``(N,)`` at the begin.
        pressed: Boolean ``(N,)``: the wrist was strained at the begin, by what is to be left behind.
    """

    path: Path
    start: Array
    pressed: Array


@register("concept")
class Withdraw(ConceptModel[WithdrawMemory]):
    """Open the hand and draw it straight back, so that a task can be begun anew.

    It needs no object: what is in the hand is let go where it is. It draws back as far as it touches nothing
    else, and fails where it cannot, or where it has not come there.

    Args:
        distance: How far the tool goes, where there is room.
        direction: Which way, robot base frame; by default back, against its approach.
        opening: Time in which the hand opens.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which it is broken off, where there was less when it began.
    """

    distance: Metres = 0.10
    direction: Direction | None = None
    opening: Seconds = 0.6
    speed: MetresPerSecond = 0.3
    force_limit: Newtons = FORCE_LIMIT

    establishes = (ConditionOf("HandEmpty"),)
    default_timeout = 3600.0

    def begin(self, seen: Seen) -> WithdrawMemory:
        """A straight path back, as far as it is clear.

        Raises:
            NoWayError: In one of the worlds none is.
        """
        found = [
            clear_retreat(view, view.robot.hand_open, self.distance, [self._way(view)], _in_reach(view))
            for view in views(seen)
        ]
        pressed = strain(seen, self.force_limit).applies
        return WithdrawMemory(retreat_path(seen, found, self.speed), seen.closure, pressed)

    def _way(self, view: WorldView) -> Array:
        """Unit vector ``(3,)`` in which the hand draws back."""
        back: Array = -poses.z_axis(view.tool[3:]) if self.direction is None else np.array(self.direction)
        return back

    def command(self, action: Array, seen: Seen, memory: WithdrawMemory) -> Command:
        """Open, then draw back."""
        closed = memory.start * poses.clip(1.0 - 2.0 * seen.elapsed / max(self.opening, 1e-9), 0.0, 1.0)
        since = poses.clip(seen.elapsed - self.opening, 0.0, 3600.0)
        tool, arm = at_times(memory.path, since)
        return Command(tool=tool, hand=closed[:, None], posture=arm)

    def limits(self, seen: Seen, memory: WithdrawMemory) -> tuple[Limit, ...]:
        """The force at the wrist; and the tool has had the time to draw back, and has not."""
        relieved = ~memory.pressed | (seen.elapsed - self.opening >= RELIEF)
        late = seen.elapsed - self.opening - memory.path.duration >= PATIENCE
        not_back = Limit(NOT_BACK, miss(seen, memory.path), self.tolerance, counts=late)
        return strain(seen, self.force_limit)._replace(counts=relieved), not_back

    def done(self, seen: Seen, memory: WithdrawMemory) -> Array:
        """The tool has drawn back."""
        late = seen.elapsed - self.opening - memory.path.duration
        return (late >= 0.0) & (miss(seen, memory.path) <= self.tolerance)

    def necessary_cost(self, seen: Seen, memory: WithdrawMemory) -> Array:
        """Distance of the tool from the end of the path, metres."""
        return miss(seen, memory.path)

    def explain(self, seen: Seen, memory: WithdrawMemory) -> Statement:
        """How far the hand is open, the tool from its goal, and the force at the wrist."""
        return WITHDRAWN(
            opening=1.0 - seen.closure, distance=miss(seen, memory.path), force=force_at_wrist(seen)
        )


def _in_reach(view: WorldView) -> set[str]:
    """Objects that the hand may hold: it lets go of whatever is there."""
    beside = {
        name: abs(poses.localise(pose, view.tool[:3])) - np.array(view.model(name).extent) / 2
        for name, pose in view.objects.items()
    }
    return {name for name, gap in beside.items() if float(np.linalg.norm(np.maximum(gap, 0.0))) < REACH}
