"""Wait: let time pass while the robot holds still."""

from __future__ import annotations

from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Seconds
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.limits import longer_than_allowed
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import SECONDS
from bt_tasksim.core.world import Command

WAITED = Form("waited {waited:.2f} of {duration:g}", {"waited": SECONDS, "duration": SECONDS})


@register("concept")
class Wait(ConceptModel[None]):
    """Hold still for a while, such as until what has fallen has come to rest.

    Args:
        duration: How long.
    """

    duration: Seconds

    default_timeout = 3600.0

    def contradiction(self) -> str:
        """Time for what is asked."""
        return longer_than_allowed(self.duration, self.timeout)

    def command(self, action: Array, seen: Seen, memory: None) -> Command:
        """Nothing: both parts keep their last targets."""
        return Command()

    def done(self, seen: Seen, memory: None) -> Array:
        """The time is over."""
        return seen.elapsed >= self.duration

    def necessary_cost(self, seen: Seen, memory: None) -> Array:
        """Seconds that remain."""
        return self.duration - seen.elapsed

    def explain(self, seen: Seen, memory: None) -> Statement:
        """How long it has waited."""
        return WAITED(waited=seen.elapsed, duration=self.duration)
