"""Do two things touch, as far as is seen: no sensor of a robot says so of what it does not hold."""

from __future__ import annotations

import numpy as np

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.parameters import Metres, ObjectName, PlaceName
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.core.narrow_phase import coal
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES
from bt_tasksim.planning.surroundings import things_of
from bt_tasksim.planning.things import Thing, shapes_of
from bt_tasksim.robot.kinematics.models import se3

APART = Form("{object} is {gap} from {other}", {"gap": METRES})
FAR = 10.0
"""Metres that things are taken to be apart of which one was never seen or is not there."""


@register("concept")
class InContact(Condition):
    """Does the object touch another one, or the furniture of a place, as far as is seen?

    It is judged by where things are estimated to be and by the shapes that they are known to have. So things
    that nearly touch may count as touching, by what estimates are wrong.

    Args:
        target: The object.
        other: The other object, or a place: then the furniture that it belongs to.
        tolerance: How far apart they may seem to be.
    """

    target: ObjectName
    other: PlaceName
    tolerance: Metres = 0.006

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return self._gap(seen) <= self.tolerance

    def explain(self, seen: Seen) -> Statement:
        """How far they are apart."""
        return APART(object=self.target, other=self.other, gap=self._gap(seen))

    def _gap(self, seen: Seen) -> Array:
        """Metres ``(N,)`` between them; 0 where they overlap."""
        key = ("gap", self.target, self.other)
        gaps = seen.once(key, lambda: [_gap(view, self.target, self.other) for view in views(seen)])
        xp, like = array_namespace(seen.tool), seen.tool
        return xp.asarray(np.array(gaps), dtype=like.dtype, device=like.device)


def _gap(view: WorldView, target: str, other: str) -> float:
    if target not in view.objects:
        return FAR
    things = things_of(view.world, view.objects, closer=1.0)
    theirs = view.world.thing_of(other)
    pairs = [
        _distance(mine, their)
        for mine in things
        if mine.name == target
        for their in things
        if their.name == theirs and their is not mine
    ]
    return round(min(pairs, default=FAR), 9)


def _distance(mine: Thing, their: Thing) -> float:
    """Metres between two things' solids."""
    placed = [coal.Transform3s(p.rotation, p.translation) for p in map(se3, (mine.pose, their.pose))]
    return min(
        max(
            0.0,
            float(coal.distance(a, placed[0], b, placed[1], coal.DistanceRequest(), coal.DistanceResult())),
        )
        for a in shapes_of(mine)
        for b in shapes_of(their)
    )
