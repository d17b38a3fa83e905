"""How something is turned in the hand: what it is asked, and by how much it is turned otherwise."""

from __future__ import annotations

from typing import Any

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.parameters import Direction, ObjectName, PlaceName, Radians
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.destination import standing_pose
from bt_tasksim.concept_nodes.holding import holding
from bt_tasksim.core import poses
from bt_tasksim.core.fact_arrays import ObjectFacts
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import RADIANS
from bt_tasksim.scene.specs import Goal

TURNED_BY = Form("{object} is {angle:.0f} from how it should be turned", {"angle": RADIANS})
UP = (0.0, 0.0, 1.0)


class _HeldTurned(Condition):
    """A question about how something is turned in the hand."""

    target: str
    tolerance: float

    in_hand = True

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return holding(seen, self.target) & (self._off(seen) < self.tolerance)

    def explain(self, seen: Seen) -> Statement:
        """How far it is turned from that."""
        return TURNED_BY(object=self.target, angle=self._off(seen))

    def _off(self, seen: Seen) -> Array:
        """Angles ``(N,)`` from how it should be turned, radians."""
        raise NotImplementedError

    @classmethod
    def _limited(cls, goal: Goal, asked: dict[str, Any]) -> dict[str, Any]:
        """The same with the goal's own tolerance where that is tighter."""
        if goal.angle_tolerance != Goal.angle_tolerance:
            asked["tolerance"] = min(goal.angle_tolerance, cls.tolerance)
        return asked


@register("concept")
class Oriented(_HeldTurned):
    """Is the held object turned as a place or another object is, up to its symmetry?

    Args:
        target: The object.
        like: The place, or the other object.
        angle: By how much it should be turned from that,
        axis: and about which axis in the frame of that.
        tolerance: How far it may be from there.
    """

    target: ObjectName
    like: PlaceName
    angle: Radians = 0.0
    axis: Direction = UP
    tolerance: Radians = 0.15

    relation = "oriented"
    rests_on_place = False

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`; a goal's own tolerance counts where it is tighter."""
        asked = {
            "target": goal.object,
            "like": goal.place,
            "angle": goal.value or 0.0,
            "axis": goal.axis or UP,
        }
        return cls._limited(goal, asked)

    def _off(self, seen: Seen) -> Array:
        should = turned_frame(seen, self.like, self.angle, self.axis)
        return poses.norm(missing_turn(seen.object(self.target), should, seen.model(self.target)))


@register("concept")
class PointingUp(_HeldTurned):
    """Does an axis of the held object point up?

    Args:
        target: The object.
        axis: The axis, in the object's frame: that of z upwards is upright, downwards upside down.
        tolerance: How far it may lean.
    """

    target: ObjectName
    axis: Direction = UP
    tolerance: Radians = 0.15

    relation = "pointing_up"

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`; a goal's own tolerance counts where it is tighter."""
        return cls._limited(goal, {"target": goal.object, "axis": goal.axis or UP})

    def _off(self, seen: Seen) -> Array:
        return poses.norm(missing_lean(seen.object(self.target), self.axis))


def turned_frame(seen: Seen, like: str, angle: float, axis: tuple[float, float, float]) -> Array:
    """Poses ``(N, 7)`` of a place or an object, turned about an axis in its frame, radians."""
    frame = seen.place(like).pose if like in seen.world.place_columns else seen.object(like)
    turn = poses.from_rotation_vector(angle * constant(axis, frame))
    xp = array_namespace(frame)
    return xp.concat([frame[:, :3], poses.quat_multiply(frame[:, 3:], turn + 0.0 * frame[:, 3:])], axis=-1)


def missing_turn(now: Array, should: Array, model: ObjectFacts) -> Array:
    """Rotation vectors ``(N, 3)`` by which things have to be turned to be like others, radians.

    Args:
        now: Poses ``(N, 7)`` of the things.
        should: Poses ``(N, 7)`` like which they should be turned, up to their symmetry.
        model: The things.
    """
    goal = standing_pose(should, now, model)
    return poses.rotation_vector(poses.quat_multiply(goal[:, 3:], poses.quat_conjugate(now[:, 3:])))


def missing_lean(now: Array, axis: tuple[float, float, float]) -> Array:
    """Rotation vectors ``(N, 3)`` by which things have to be turned until an axis of theirs points up.

    Args:
        now: Poses ``(N, 7)`` of the things.
        axis: The axis, in their frame.
    """
    up = poses.rotate(now[:, 3:], constant(axis, now) + 0.0 * now[:, :3])
    return poses.shortest_turn(up, constant(UP, now) + 0.0 * up)
