"""Wait: let time pass while the robot holds still."""

from __future__ import annotations

from typing import Any

from bt_tasksim.concept import ConceptModel
from bt_tasksim.context import Seen
from bt_tasksim.parameters import Seconds
from bt_tasksim.poses import Array
from bt_tasksim.world import Command


class Wait(ConceptModel):
    """Hold still for a while, such as until what has fallen has come to rest.

    Args:
        duration: How long.
    """

    duration: Seconds

    default_timeout = 3600.0

    def command(self, action: Array, seen: Seen, memory: Any) -> Command:
        """Nothing: both parts keep their last targets."""
        return Command()

    def done(self, seen: Seen, memory: Any) -> Array:
        """The time is over."""
        return seen.elapsed >= self.duration

    def necessary_cost(self, seen: Seen, memory: Any) -> Array:
        """Seconds that remain."""
        return self.duration - seen.elapsed

    def explain(self, seen: Seen, memory: Any) -> str:
        """How long it has waited."""
        return f"waited {float(seen.elapsed):.2f} of {self.duration:g} s"
