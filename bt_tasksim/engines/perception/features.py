"""From a world state and an estimate to an observation: force features and aligned visual ones."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Observation, WorldState
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.shapes import Shape

TOUCH = 0.2
"""N on a fingertip that count as contact."""


class ObservationBuilder:
    """Builds observations, the same way whatever the estimate came from.

    Args:
        robot: The robot.
        configuration: The episode's world; of its objects only what perception knows is used: their shapes.
    """

    def __init__(self, robot: RobotDescription, configuration: ActorConfiguration) -> None:
        self._robot = robot
        self._n_arm = len(robot.arm_joints)
        self._limit = robot.hand_drive.force_limit * robot.hand_drive_scale
        self._shapes = [actor.known_shape() for actor in configuration.objects]
        self._before: _Instant | None = None

    def build(self, state: WorldState, estimate: Array) -> Observation:
        """The observation for estimated object poses ``(n_objects, 7)``."""
        n = self._n_arm
        now = _Instant(float(state.time), state.tool_pose, estimate)
        force = state.tip_force
        arm, hand = state.joint_position[:n], state.joint_position[n:]
        known = (
            state.time,
            arm,
            state.joint_velocity[:n],
            hand,
            state.joint_effort[n:] / self._limit,
            self._robot.closure(hand),
            state.tool_pose,
            state.tips,
            np.array([x * x + y * y + z * z > TOUCH * TOUCH for x, y, z in force.tolist()]),
            force,
            state.wrench,
            estimate,
        )
        observation = LazyObservation.of(known, (self._shapes, self._before, now))
        self._before = now
        return observation


class _Instant:
    """What the visual features of an instant are made of."""

    __slots__ = ("objects", "time", "tool")

    def __init__(self, time: float, tool: Array, objects: Array) -> None:
        self.time = time
        self.tool = tool
        self.objects = objects

    def nearest(self) -> int:
        """Index of the object nearest to the tool; -1 where there is none, or none was ever seen (NaN)."""
        if len(self.objects) == 1:
            return -1 if math.isnan(self.objects[0, 0]) else 0
        gap = self.objects[:, :3] - self.tool[:3]
        distance = (gap * gap).sum(-1)
        seen = ~np.isnan(distance)
        return int(np.argmin(np.where(seen, distance, np.inf))) if seen.any() else -1


def contact_points(shapes: list[Shape], now: _Instant, tips: Array) -> Array:
    """The points ``(n_tips, 3)`` of the nearest object that the fingertips would touch."""
    which = now.nearest()
    if which < 0:
        return tips.copy()
    there, nearest = now.objects[which].tolist(), shapes[which].surface.one
    back = poses.inverted(there)
    return np.array([poses.point(there, nearest(*poses.point(back, tip))) for tip in tips.tolist()])


def motion(before: _Instant | None, now: _Instant) -> Array:
    """Twist ``(6,)`` of the nearest object relative to the tool, by a finite difference, tool frame."""
    which = now.nearest()
    if before is None or which < 0 or which != before.nearest() or now.time <= before.time:
        return np.zeros(6)
    first, last = (poses.multiply(poses.inverse(i.tool), i.objects[which]) for i in (before, now))
    turned = poses.quat_multiply(last[3:], poses.quat_conjugate(first[3:]))
    twist = np.concatenate([last[:3] - first[:3], poses.rotation_vector(turned)])
    return twist / (now.time - before.time)


class LazyObservation(Observation):
    """An observation whose visual features are computed when they are looked at: most ticks never do."""

    __slots__ = ("_contact_points", "_motion", "_source")
    _source: tuple[list[Shape], _Instant | None, _Instant]
    _contact_points: Array | None
    _motion: Array | None

    @classmethod
    def of(
        cls, known: tuple[Array, ...], source: tuple[list[Shape], _Instant | None, _Instant]
    ) -> LazyObservation:
        """An observation of fields in their order, without the visual ones, and what those are made of."""
        self: LazyObservation = object.__new__(cls)
        for name, value in zip(_KNOWN, known, strict=True):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "_source", source)
        object.__setattr__(self, "_contact_points", None)
        object.__setattr__(self, "_motion", None)
        return self

    @property
    def contact_points(self) -> Array:
        """See `Observation`."""
        if self._contact_points is None:
            shapes, _, now = self._source
            object.__setattr__(self, "_contact_points", contact_points(shapes, now, self.tips))
        return self._contact_points

    @contact_points.setter
    def contact_points(self, value: Array) -> None:
        object.__setattr__(self, "_contact_points", value)

    @property
    def motion(self) -> Array:
        """See `Observation`."""
        if self._motion is None:
            _, before, now = self._source
            object.__setattr__(self, "_motion", motion(before, now))
        return self._motion

    @motion.setter
    def motion(self, value: Array) -> None:
        object.__setattr__(self, "_motion", value)


_KNOWN = tuple(f.name for f in fields(Observation) if f.name not in ("contact_points", "motion"))
