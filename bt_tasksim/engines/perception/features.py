"""From states and estimates to observations: force features and aligned visual ones, of many worlds at once.

A single world is the case of one, without the leading axis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace, constant, host
from bt_tasksim.core.transfer import Index, spliced
from bt_tasksim.core.world import Observation, WorldState
from bt_tasksim.engines.perception.parts import Parts
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.surfaces import ManySurfaces, OuterSurface

TOUCH = 0.2
"""N on a fingertip that count as contact."""


class Instant(NamedTuple):
    """What the visual features of an instant are made of.

    Attributes:
        time: ``(k,)`` seconds; NaN where there was no such instant.
        tool: ``(k, 7)``.
        objects: ``(k, n_objects, 7)`` estimates; NaN where there is no object, or none was ever seen.
    """

    time: Array
    tool: Array
    objects: Array

    def nearest(self) -> Array:
        """Index ``(k,)`` of the object nearest to each tool; -1 where there is none, or none was seen."""
        xp = array_namespace(self.tool)
        k, most = self.objects.shape[:2]
        if not most:
            return xp.full((k,), -1, dtype=xp.int64, device=self.tool.device)
        gap = self.objects[..., :3] - self.tool[:, None, :3]
        distance = gap[..., 0] * gap[..., 0] + gap[..., 1] * gap[..., 1] + gap[..., 2] * gap[..., 2]
        seen = ~xp.isnan(distance)
        which = xp.argmin(xp.where(seen, distance, xp.full_like(distance, xp.inf)), axis=-1)
        return xp.where(xp.any(seen, axis=-1), which, -xp.ones_like(which))

    def object(self, which: Array) -> Array:
        """Poses ``(k, 7)`` of one object in each world; those of the first where the index is -1."""
        xp = array_namespace(self.objects)
        out = self.objects[:, 0, :]
        for i in range(1, self.objects.shape[1]):
            out = xp.where((which == i)[:, None], self.objects[:, i, :], out)
        return out


class Surfaces:
    """The outer surfaces of the objects of worlds; those that were asked for last are kept joined.

    Args:
        worlds: The surfaces of each world's objects.
    """

    def __init__(self, worlds: Sequence[tuple[OuterSurface, ...]]) -> None:
        self.worlds = tuple(worlds)
        self._key: tuple[bytes, bytes] | None = None
        self._joined = ManySurfaces([])

    def of(self, rows: np.ndarray, which: np.ndarray) -> ManySurfaces:
        """One surface ``which (k,)`` of each of the worlds ``rows (k,)``; any at all where that is -1."""
        key = (rows.tobytes(), which.tobytes())
        if key != self._key:
            some = next(world[0] for world in self.worlds if world)
            pairs = zip(rows.tolist(), which.tolist(), strict=True)
            self._joined = ManySurfaces([some if i < 0 else self.worlds[row][i] for row, i in pairs])
            self._key = key
        return self._joined


def contact_points(surfaces: Surfaces, rows: np.ndarray, now: Instant, tips: Array) -> Array:
    """The points ``(k, n_tips, 3)`` of the nearest objects that the fingertips would touch.

    Where no object was ever seen these are the tips themselves.

    Args:
        surfaces: Of the objects of all worlds.
        rows: Which worlds these are ``(k,)``.
        now: What was seen in them.
        tips: The fingertips ``(k, n_tips, 3)``.
    """
    xp = array_namespace(tips)
    which = now.nearest()
    none = which < 0
    if bool(xp.all(none)):
        return xp.asarray(tips, copy=True)
    there = xp.where(none[:, None], xp.ones_like(now.tool), now.object(which))[:, None, :]
    joined = surfaces.of(rows, host(which))
    local = joined.nearest(poses.transform(poses.inverse(there), tips))
    return xp.where(none[:, None, None], tips, poses.transform(there, local))


def motion(before: Instant, now: Instant) -> Array:
    """Twists ``(k, 6)`` of the nearest objects relative to the tools, by a finite difference, tool frame.

    Zero where nothing is known of them.
    """
    xp = array_namespace(now.tool)
    which = now.nearest()
    known = (which >= 0) & (which == before.nearest()) & (now.time > before.time)
    zero = xp.zeros((which.shape[0], 6), dtype=now.tool.dtype, device=now.tool.device)
    if not bool(xp.any(known)):
        return zero
    first, last = (poses.multiply(poses.inverse(i.tool), i.object(which)) for i in (before, now))
    turned = poses.quat_multiply(last[:, 3:], poses.quat_conjugate(first[:, 3:]))
    twist = xp.concat([last[:, :3] - first[:, :3], poses.rotation_vector(turned)], axis=-1)
    span = xp.where(known, now.time - before.time, xp.ones_like(now.time))
    return xp.where(known[:, None], twist / span[:, None], zero)


class BatchObservations:
    """Builds observations of ``n`` worlds, the same way whatever the estimates came from.

    Args:
        robot: The robot.
        n: Number of worlds.
    """

    def __init__(self, robot: RobotDescription, n: int) -> None:
        self._robot, self.n = robot, n
        self._n_arm = len(robot.arm_joints)
        self._limit = robot.hand_drive.force_limit * robot.hand_drive_scale
        self._surfaces = Surfaces([()] * n)
        self._all = np.arange(n)
        self._parts = Parts(n)
        self._last: Instant | None = None

    def reset(self, rows: Sequence[int] | np.ndarray, configurations: Sequence[ActorConfiguration]) -> None:
        """Worlds begin new episodes; of their objects only what perception knows is used: their shapes."""
        worlds = list(self._surfaces.worlds)
        for row, configuration in zip(rows, configurations, strict=True):
            worlds[row] = tuple(actor.known_shape().surface for actor in configuration.objects)
        self._parts.reset(rows, configurations)
        self._surfaces = Surfaces(worlds)  # a new one: older observations go on with theirs
        if self._last is not None:
            none = np.full(len(configurations), np.nan)
            time = spliced([self._last.time], np.asarray(rows, int), [constant(none, self._last.time)])[0]
            self._last = self._last._replace(time=time)

    def build(self, state: WorldState, estimate: Array, rows: np.ndarray | None = None) -> Observation:
        """The observations ``(k, ...)`` for estimated object poses ``(k, n_objects, 7)``.

        Args:
            state: The states ``(k, ...)``.
            estimate: Worlds with fewer objects than others have NaN behind theirs.
            rows: Which worlds these are ``(k,)``, each once; by default all.
        """
        n, force = self._n_arm, state.tip_force
        x, y, z = force[..., 0], force[..., 1], force[..., 2]
        hand = state.joint_position[:, n:]
        touching, closure = x * x + y * y + z * z > TOUCH * TOUCH, self._robot.closure(hand)
        estimate = self._parts.placed(state, touching, closure, estimate, self._all if rows is None else rows)
        known = (
            state.time,
            state.joint_position[:, :n],
            state.joint_velocity[:, :n],
            hand,
            state.joint_effort[:, n:] / constant(self._limit, state.joint_effort),
            closure,
            state.tool_pose,
            state.tips,
            touching,
            force,
            state.wrench,
            estimate,
        )
        now, index = Instant(state.time, state.tool_pose, estimate), self._all if rows is None else rows
        before, surfaces, tips = self._last, self._surfaces, state.tips
        self._last = now if rows is None else _merged(before, now, rows, self.n)

        def moved() -> Array:
            if before is None:
                return motion(now._replace(time=now.time * np.nan), now)
            if rows is None:
                return motion(before, now)
            picked = Index(rows)
            return motion(Instant(*(picked.along(x, 0) for x in before)), now)

        return LazyObservation.of(known, lambda: contact_points(surfaces, index, now, tips), moved)


class ObservationBuilder:
    """`BatchObservations` of one world, without the leading axis.

    Args:
        robot: The robot.
        configuration: The episode's world; of its objects only what perception knows is used: their shapes.
    """

    def __init__(self, robot: RobotDescription, configuration: ActorConfiguration) -> None:
        self._batch = BatchObservations(robot, 1)
        self._batch.reset([0], [configuration])

    def build(self, state: WorldState, estimate: Array) -> Observation:
        """The observation for estimated object poses ``(n_objects, 7)``."""
        return alone(self._batch.build(with_axis(state), estimate[None]))


def with_axis(state: WorldState) -> WorldState:
    """The state of one world as that of a batch of one."""
    values = (getattr(state, name) for name in _STATE)
    return WorldState(*(None if value is None else np.asarray(value)[None] for value in values))


def alone(seen: Observation) -> Observation:
    """The observation of the first world of a batch, without the leading axis."""
    known = tuple(getattr(seen, name)[0] for name in _KNOWN)
    return LazyObservation.of(known, lambda: seen.contact_points[0], lambda: seen.motion[0])


def _merged(before: Instant | None, now: Instant, rows: np.ndarray, n: int) -> Instant:
    """What was seen last in all worlds, now that some of them have been seen anew."""
    xp = array_namespace(now.tool)
    if before is None:
        before = Instant(*(xp.full((n, *x.shape[1:]), xp.nan, dtype=x.dtype, device=x.device) for x in now))
    most = max(before.objects.shape[1], now.objects.shape[1])
    before, now = (i._replace(objects=widened(i.objects, most)) for i in (before, now))
    return Instant(*spliced(before, rows, now))


def widened(objects: Array, most: int) -> Array:
    """Poses ``(k, n, 7)`` of objects as poses ``(k, most, 7)``, those that there are not being NaN."""
    k, n = objects.shape[:2]
    if n >= most:
        return objects
    xp = array_namespace(objects)
    none = xp.full((k, most - n, 7), xp.nan, dtype=objects.dtype, device=objects.device)
    return xp.concat([objects, none], axis=1)


class LazyObservation(Observation):
    """An observation whose visual features are computed when they are looked at: most ticks never do."""

    __slots__ = ("_contact_points", "_motion", "_motion_of", "_points_of")
    _contact_points: Array | None
    _motion: Array | None
    _points_of: Callable[[], Array]
    _motion_of: Callable[[], Array]

    @classmethod
    def of(
        cls, known: tuple[Array, ...], points_of: Callable[[], Array], motion_of: Callable[[], Array]
    ) -> LazyObservation:
        """An observation of fields in their order, without the visual ones, and what computes those."""
        self: LazyObservation = object.__new__(cls)
        for name, value in zip(_KNOWN, known, strict=True):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "_points_of", points_of)
        object.__setattr__(self, "_motion_of", motion_of)
        object.__setattr__(self, "_contact_points", None)
        object.__setattr__(self, "_motion", None)
        return self

    @property
    def contact_points(self) -> Array:
        """See `Observation`."""
        if self._contact_points is None:
            object.__setattr__(self, "_contact_points", self._points_of())
        return self._contact_points

    @contact_points.setter
    def contact_points(self, value: Array) -> None:
        object.__setattr__(self, "_contact_points", value)

    @property
    def motion(self) -> Array:
        """See `Observation`."""
        if self._motion is None:
            object.__setattr__(self, "_motion", self._motion_of())
        return self._motion

    @motion.setter
    def motion(self, value: Array) -> None:
        object.__setattr__(self, "_motion", value)


_KNOWN = tuple(f.name for f in fields(Observation) if f.name not in ("contact_points", "motion"))
_STATE = tuple(f.name for f in fields(WorldState))
