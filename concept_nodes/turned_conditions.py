"""Conditions about things that are turned, tipped up, laid down or emptied."""

from __future__ import annotations

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.parameters import ObjectName
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.contents import seen_within
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import COUNT

LEFT = Form("{count} things are in {object}", {"count": COUNT})


@register("concept")
class Emptied(Condition):
    """Is nothing seen in the hollow of the object?

    Args:
        target: The vessel.
    """

    target: ObjectName

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return self._count(seen) == 0

    def explain(self, seen: Seen) -> Statement:
        """How many things are in it."""
        return LEFT(object=self.target, count=self._count(seen))

    def _count(self, seen: Seen) -> Array:
        others = [name for name in seen.world.columns if name != self.target]
        xp = array_namespace(seen.tool)
        return xp.count_nonzero(seen_within(seen, self.target, others), axis=-1)
