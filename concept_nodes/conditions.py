"""Condition leaves: questions that are answered at once, for reactive and recovering trees."""

from __future__ import annotations

import math

from bt_tasksim import poses
from bt_tasksim.concept import Condition
from bt_tasksim.context import Seen
from bt_tasksim.parameters import Metres, ObjectName, PlaceName, Radians, Seconds
from bt_tasksim.poses import Array, array_namespace
from concept_nodes.bring import destination, standing_pose
from concept_nodes.holding import holding, tool_distance


class Holding(Condition):
    """Is the object in the hand?

    Args:
        target: The object.
    """

    target: ObjectName

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return holding(seen, self.target)

    def explain(self, seen: Seen) -> str:
        """How far the object is from the tool."""
        return f"{self.target} is {1000 * float(tool_distance(seen, self.target)):.0f} mm from the tool"


class AtPose(Condition):
    """Does the object stand where it should, as far as can be seen?

    Args:
        target: The object.
        on: The place, or another object.
        tolerance: How far off it may be.
        angle: How much it may be turned or tilted from the nearest pose that looks right.
    """

    target: ObjectName
    on: PlaceName
    tolerance: Metres = 0.02
    angle: Radians = 0.2

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        distance, angle = self._off(seen)
        return (distance < self.tolerance) & (angle < self.angle)

    def explain(self, seen: Seen) -> str:
        """How far off it is."""
        distance, angle = self._off(seen)
        degrees = math.degrees(float(angle))
        return f"{self.target} is {1000 * float(distance):.0f} mm and {degrees:.0f} degrees off"

    def _off(self, seen: Seen) -> tuple[Array, Array]:
        now = seen.object(self.target)
        frame, _ = destination(seen, self.on)
        goal = standing_pose(frame, now, seen.model(self.target), 0.0)
        gap = now[..., :3] - goal[..., :3]
        return poses.norm(gap), poses.angle_between(now[..., 3:], goal[..., 3:])


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

    def explain(self, seen: Seen) -> str:
        """How far it is tilted."""
        return f"{self.target} is tilted by {math.degrees(float(self._tilt(seen))):.0f} degrees"

    def _tilt(self, seen: Seen) -> Array:
        pose = seen.object(self.target)
        up = poses.rotate(pose[..., 3:], poses.constant([0.0, 0.0, 1.0], pose))
        xp = array_namespace(up)
        return xp.acos(xp.clip(up[..., 2], -1.0, 1.0))


class TimePassed(Condition):
    """Has so much time passed since the episode began?

    Args:
        duration: The time.
    """

    duration: Seconds

    def holds(self, seen: Seen) -> Array:
        """See `Condition.holds`."""
        return seen.observation.time >= self.duration

    def explain(self, seen: Seen) -> str:
        """The time."""
        return f"{float(seen.observation.time):.2f} s have passed"
