"""Condition leaves: questions that are answered at once, for reactive and recovering trees."""

from __future__ import annotations

from typing import Any

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.parameters import Metres, ObjectName, PlaceName, Radians, Seconds
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.destination import destination, standing_pose
from bt_tasksim.concept_nodes.holding import holding, tool_distance
from bt_tasksim.concept_nodes.whereabouts import Estimates
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array, host
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, RADIANS, SECONDS
from bt_tasksim.scene.spatial_laws import IsOn, is_on
from bt_tasksim.scene.specs import Goal

FROM_TOOL = Form("{object} is {distance} from the tool", {"distance": METRES})
OFF = Form("{object} is {distance} and {angle:.0f} off{upon}", {"distance": METRES, "angle": RADIANS})
UPON = ", beside what it should stand on or on something else"
TILTED = Form("{object} is tilted by {angle:.0f}", {"angle": RADIANS})
PASSED = Form("{time:.2f} have passed", {"time": SECONDS})


@register("concept")
class Holding(Condition):
    """Is the object in the hand?

    Args:
        target: The object.
    """

    target: ObjectName

    in_hand = True

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return holding(seen, self.target)

    def explain(self, seen: Seen) -> Statement:
        """How far the object is from the tool."""
        return FROM_TOOL(object=self.target, distance=tool_distance(seen, self.target))


@register("concept")
class AtPose(Condition):
    """Does the object stand where it should, and on nothing else, as far as can be seen?

    Args:
        target: The object.
        on: The place, or another object.
        tolerance: How far off it may be.
        angle: How much it may be turned or tilted from the nearest pose that looks right; on another object,
            which may be turned anyhow itself, how much it may be tilted.
    """

    target: ObjectName
    on: PlaceName
    tolerance: Metres = 0.02
    angle: Radians = 0.2

    relation = "on"
    takes_middle = True

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """See `Condition.from_goal`; a goal's own tolerances count where they are tighter."""
        asked: dict[str, Any] = {"target": goal.object, "on": goal.place}
        if goal.position_tolerance != Goal.position_tolerance:
            asked["tolerance"] = min(goal.position_tolerance, cls.tolerance)
        if goal.angle_tolerance != Goal.angle_tolerance:
            asked["angle"] = min(goal.angle_tolerance, cls.angle)
        return asked

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        distance, angle = self._off(seen)
        borne = self._found(seen).is_borne(self.on not in seen.world.place_columns)
        return (distance < self.tolerance) & (angle < self.angle) & borne

    def explain(self, seen: Seen) -> Statement:
        """How far off it is."""
        distance, angle = self._off(seen)
        borne = host(self._found(seen).is_borne(self.on not in seen.world.place_columns))
        upon = tuple("" if there else UPON for there in borne.tolist())
        return OFF(object=self.target, distance=distance, angle=angle, upon=upon)

    def _found(self, seen: Seen) -> IsOn:
        key = ("is on", self.target, self.on)
        return seen.once(key, lambda: is_on(Estimates.of(seen), self.target, self.on))

    def _off(self, seen: Seen) -> tuple[Array, Array]:
        now = seen.object(self.target)
        frame, _ = destination(seen, self.on)
        goal = standing_pose(frame, now, seen.model(self.target))
        gap = now[:, :3] - goal[:, :3]
        if self.on in seen.world.place_columns:
            return poses.norm(gap), poses.angle_between(now[:, 3:], goal[:, 3:])
        return poses.norm(gap), poses.tilt(now[:, 3:], goal[:, 3:])


@register("concept")
class Upright(Condition):
    """Does the object stand upright?

    Args:
        target: The object.
        angle: How far it may be tilted.
    """

    target: ObjectName
    angle: Radians = 0.2

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return self._tilt(seen) < self.angle

    def explain(self, seen: Seen) -> Statement:
        """How far it is tilted."""
        return TILTED(object=self.target, angle=self._tilt(seen))

    def _tilt(self, seen: Seen) -> Array:
        return poses.tilt(seen.object(self.target)[:, 3:])


@register("concept")
class TimePassed(Condition):
    """Has so much time passed since the episode began?

    Args:
        duration: The time.
    """

    duration: Seconds

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return seen.observation.time >= self.duration

    def explain(self, seen: Seen) -> Statement:
        """The time."""
        return PASSED(time=seen.observation.time)
