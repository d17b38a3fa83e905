"""Conditions about parts of furniture: how they move, and how far they are open, as far as that is seen."""

from __future__ import annotations

import math
from typing import Annotated, Any

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.parameters import MOST, ObjectName, Quantity
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register
from bt_tasksim.core.transfer import fetched
from bt_tasksim.core.units import METRES, RADIANS
from bt_tasksim.scene.joint_laws import opened, set_to, shut
from bt_tasksim.scene.specs import Goal

Opening = Annotated[float, Quantity("m or rad", low=-MOST, high=MOST)]
"""How far something is open: of what slides in metres, of what turns in radians."""
BY = Form("{object} is open by {value}")
MOVES = Form("{object} {how}")
WAYS = {None: "moves on no joint", False: "slides", True: "turns"}
SLACK = (0.006, math.radians(2.5))
"""Metres and radians by which a part may be off a value that is asked for."""


@register("concept")
class Slides(Condition):
    """Is it a part of furniture that slides, such as a drawer? It says which tasks move it.

    Args:
        target: The part.
    """

    target: ObjectName

    lasting = True

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        model = seen.model(self.target)
        return model.jointed & ~model.joint_turns

    def explain(self, seen: Seen) -> Statement:
        """How it moves."""
        return _how(seen, self.target)


@register("concept")
class Turns(Condition):
    """Is it a part of furniture that turns, such as a door? It says which tasks move it.

    Args:
        target: The part.
    """

    target: ObjectName

    lasting = True

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        model = seen.model(self.target)
        return model.jointed & model.joint_turns

    def explain(self, seen: Seen) -> Statement:
        """How it moves."""
        return _how(seen, self.target)


@register("concept")
class IsOpen(Condition):
    """Is a part of furniture open, as far as is seen?

    Args:
        target: The part.
        by: How far at least, metres or radians, from its value 0; by default most of its way.
    """

    target: ObjectName
    by: Opening | None = None

    relation = "open"

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`."""
        return {"target": goal.object} if goal.value is None else {"target": goal.object, "by": goal.value}

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        model, slack = seen.model(self.target), allowed(seen, self.target, SLACK)
        return model.jointed & opened(value_of(seen, self.target), model.joints.limits, self.by, slack).so

    def explain(self, seen: Seen) -> Statement:
        """How far it is open."""
        return _by(seen, self.target)


@register("concept")
class IsShut(Condition):
    """Is a part of furniture shut, which is at its lower limit, as far as is seen?

    Args:
        target: The part.
    """

    target: ObjectName

    relation = "shut"

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`."""
        return {"target": goal.object}

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        model = seen.model(self.target)
        return model.jointed & shut(value_of(seen, self.target), model.joints.limits, model.joint_turns).so

    def explain(self, seen: Seen) -> Statement:
        """How far it is open."""
        return _by(seen, self.target)


@register("concept")
class JointAt(Condition):
    """Is a part of furniture open just so far, as far as is seen?

    Args:
        target: The part.
        at: How far, metres or radians, from its value 0.
    """

    target: ObjectName
    at: Opening

    relation = "set"

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`."""
        return {"target": goal.object, "at": goal.value}

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        asked = set_to(value_of(seen, self.target), self.at, allowed(seen, self.target, SLACK))
        return seen.model(self.target).jointed & asked.so

    def explain(self, seen: Seen) -> Statement:
        """How far it is open."""
        return _by(seen, self.target)


@register("concept")
class OffStop(Condition):
    """Does a part of furniture stand off both of its stops, as far as is seen?

    Args:
        target: The part.
    """

    target: ObjectName

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        (low, high), value = limits_of(seen, self.target), value_of(seen, self.target)
        off = array_namespace(value).minimum(value - low, high - value)
        return seen.model(self.target).jointed & (off > allowed(seen, self.target, SLACK))

    def explain(self, seen: Seen) -> Statement:
        """How far it is open."""
        return _by(seen, self.target)


def value_of(seen: Seen, target: str) -> Array:
    """How far ``(N,)`` a part is taken to be open, metres or radians."""
    return seen.model(target).joints.value(seen.object(target))


def limits_of(seen: Seen, target: str) -> tuple[Array, Array]:
    """The lowest and the highest value ``(N,)`` of a part."""
    limits = seen.model(target).joints.limits
    return limits[:, 0], limits[:, 1]


def allowed(seen: Seen, target: str, both: tuple[float, float]) -> Array:
    """Metres ``(N,)`` where a part slides, radians where it turns."""
    turns, like = seen.model(target).joint_turns, seen.tool[:, 0]
    xp = array_namespace(like)
    slid, turned = (xp.full_like(like, value) for value in both)
    return xp.where(turns, turned, slid)


def _by(seen: Seen, target: str) -> Statement:
    values, turns = fetched([value_of(seen, target), seen.model(target).joint_turns])
    said = (
        (RADIANS if turn else METRES).text(float(value))
        for value, turn in zip(values.tolist(), turns.tolist(), strict=True)
    )
    return BY(object=target, value=tuple(said))


def _how(seen: Seen, target: str) -> Statement:
    model = seen.model(target)
    jointed, turns = fetched([model.jointed, model.joint_turns])
    said = (WAYS[t if j else None] for j, t in zip(jointed.tolist(), turns.tolist(), strict=True))
    return MOVES(object=target, how=tuple(said))
