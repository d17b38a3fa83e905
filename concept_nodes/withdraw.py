"""Withdraw: open the hand, whatever is in it, and draw it back."""

from __future__ import annotations

from typing import NamedTuple

from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Direction, Metres, MetresPerSecond, Seconds
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.carry import miss
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, SHARE
from bt_tasksim.core.world import Command
from bt_tasksim.planning.reference_motion import Path, plan, sample

WITHDRAWN = Form("hand {opening} open, tool {distance} from its goal", {"opening": SHARE, "distance": METRES})
PATIENCE = 1.0
"""Seconds after its path's end for which the tool may still be on its way."""


class WithdrawMemory(NamedTuple):
    """What a withdrawal remembers in ``N`` worlds.

    Attributes:
        path: Tool path away from where it began.
        start: Closure ``(N,)`` at the begin.
    """

    path: Path
    start: Array


@register("concept")
class Withdraw(ConceptModel[WithdrawMemory]):
    """Open the hand and draw it straight back, so that a task can be begun anew.

    It needs no object, and there is no goal that it could miss: what is in the hand is let go where it is,
    and where the tool is held up it is done a second later.

    Args:
        distance: How far the tool goes.
        direction: Which way, robot base frame; by default back, against its approach.
        opening: Time in which the hand opens.
        speed: Peak speed of the tool.
    """

    distance: Metres = 0.10
    direction: Direction | None = None
    opening: Seconds = 0.6
    speed: MetresPerSecond = 0.3

    establishes = (ConditionOf("HandEmpty"),)
    default_timeout = 3600.0

    def begin(self, seen: Seen) -> WithdrawMemory:
        """A straight path back."""
        back = -poses.z_axis(seen.tool[:, 3:])
        if self.direction is not None:
            back = 0.0 * back + poses.constant(self.direction, back)
        path = plan([seen.tool, poses.shifted(seen.tool, self.distance * back)], self.speed, samples=2)
        return WithdrawMemory(path, seen.closure)

    def command(self, action: Array, seen: Seen, memory: WithdrawMemory) -> Command:
        """Open, then draw back."""
        closed = memory.start * poses.clip(1.0 - 2.0 * seen.elapsed / max(self.opening, 1e-9), 0.0, 1.0)
        since = poses.clip(seen.elapsed - self.opening, 0.0, 3600.0)
        return Command(tool=sample(memory.path, since), hand=closed[:, None])

    def done(self, seen: Seen, memory: WithdrawMemory) -> Array:
        """The tool has drawn back, or has had the time to."""
        late = seen.elapsed - self.opening - memory.path.duration
        return ((late >= 0.0) & (miss(seen, memory.path) < self.tolerance)) | (late >= PATIENCE)

    def necessary_cost(self, seen: Seen, memory: WithdrawMemory) -> Array:
        """Distance of the tool from the end of the path, metres."""
        return miss(seen, memory.path)

    def explain(self, seen: Seen, memory: WithdrawMemory) -> Statement:
        """How far the hand is open, and the tool from its goal."""
        return WITHDRAWN(opening=1.0 - seen.closure, distance=miss(seen, memory.path))
