"""Settle: hold still until nothing moves any more."""

from __future__ import annotations

from typing import NamedTuple

from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Metres, Seconds
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, SECONDS
from bt_tasksim.core.world import Command

SETTLED = Form("nothing moved for {still:.2f}, {moved} since then", {"still": SECONDS, "moved": METRES})


class SettleMemory(NamedTuple):
    """What is remembered in ``N`` worlds.

    Attributes:
        positions: Of the objects ``(N, n_objects, 3)`` when one moved last.
        since: Seconds ``(N,)`` of the leaf at which that was.
    """

    positions: Array
    since: Array


@register("concept")
class Settle(ConceptModel[SettleMemory]):
    """Hold still until no object is seen to move, such as after something was pushed or has fallen.

    Args:
        still: How long none should have moved.
        slack: How far estimates may jump while nothing moves.
        longest: Time after which it is done in any case.
    """

    still: Seconds = 0.3
    slack: Metres = 0.008
    longest: Seconds = 4.0

    default_timeout = 3600.0

    def begin(self, seen: Seen) -> SettleMemory:
        """Where the objects are."""
        return SettleMemory(
            seen.observation.objects[..., :3], array_namespace(seen.tool).zeros_like(seen.elapsed)
        )

    def command(self, action: Array, seen: Seen, memory: SettleMemory) -> Command:
        """Nothing: both parts keep their last targets."""
        return Command()

    def advance(self, action: Array, seen: Seen, memory: SettleMemory) -> SettleMemory:
        """Notice what has moved."""
        xp, now = array_namespace(seen.tool), seen.observation.objects[..., :3]
        moved = ~(self._moved(seen, memory) <= self.slack)
        return SettleMemory(
            xp.where(moved[:, None, None], now, memory.positions),
            xp.where(moved, seen.elapsed, memory.since),
        )

    def done(self, seen: Seen, memory: SettleMemory) -> Array:
        """Nothing has moved for long enough, or it has lasted too long."""
        rests = (self._moved(seen, memory) <= self.slack) & (seen.elapsed - memory.since >= self.still)
        return rests | (seen.elapsed >= self.longest)

    def explain(self, seen: Seen, memory: SettleMemory) -> Statement:
        """For how long nothing has moved."""
        return SETTLED(still=seen.elapsed - memory.since, moved=self._moved(seen, memory))

    def _moved(self, seen: Seen, memory: SettleMemory) -> Array:
        """Largest distance ``(N,)`` in metres that an object which is seen has gone."""
        xp = array_namespace(seen.tool)
        gap = poses.norm(seen.observation.objects[..., :3] - memory.positions)
        gap = xp.where(xp.isfinite(gap), gap, xp.zeros_like(gap))
        return xp.max(xp.concat([xp.zeros_like(seen.elapsed)[:, None], gap], axis=-1), axis=-1)
