"""A trajectory controller as ros2_control has one: set-points along a trajectory, and what it refuses.

A trajectory replaces the one before it and begins where that one's set-point is. Between two points the
set-point follows a cubic where velocities are given, and a straight line where they are not. After the last
point it stands. So whatever was accepted comes to rest by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bt_tasksim.core.poses import Array

MOST_POINTS = 500
LONGEST = 20.0
"""Seconds of a trajectory."""
FASTER = 1.5
"""A trajectory may ask for so many times a joint's speed, and not more."""
_SLACK = 1e-3


class RefusedTrajectoryError(ValueError):
    """A command that is not carried out, and why."""


@dataclass(frozen=True)
class Trajectory:
    """A trajectory as it came, nothing checked.

    Attributes:
        joints: Names.
        positions: A list of numbers for each point.
        velocities: Likewise; empty ones where they are not given.
        times: Seconds from the begin.
        run: Name of the run that it belongs to.
    """

    joints: Sequence[str]
    positions: Sequence[Sequence[float]]
    velocities: Sequence[Sequence[float]]
    times: Sequence[float]
    run: str = ""


class Controller:
    """Set-points of a group of joints.

    Args:
        joints: Names.
        lower: Position limits ``(n,)``.
        upper: Position limits ``(n,)``.
        speed: Speed limits ``(n,)``.
        start: Where the joints stand ``(n,)``.
    """

    def __init__(self, joints: Sequence[str], lower: Array, upper: Array, speed: Array, start: Array) -> None:
        self.joints = tuple(joints)
        self._lower, self._upper, self._speed = lower, upper, speed
        self.stand(start)

    def stand(self, position: Array) -> None:
        """Forget every trajectory, and stand at a position."""
        self._times = np.zeros(1)
        self._positions = np.array(position, float)[None]
        self._velocities = np.zeros_like(self._positions)
        self._linear = False
        self._began = 0.0

    def accept(self, trajectory: Trajectory, now: float) -> None:
        """Take a trajectory over.

        Raises:
            RefusedTrajectoryError: See `check`; the last one goes on.
        """
        times, positions, velocities = self.check(trajectory, now)
        here, speed = self.setpoint(now)
        self._linear = velocities is None
        if velocities is None:
            velocities = np.zeros_like(positions)
        self._times = np.concatenate([[0.0], times])
        self._positions = np.concatenate([here[None], positions])
        self._velocities = np.concatenate([speed[None], velocities])
        self._began = now

    def check(self, trajectory: Trajectory, now: float) -> tuple[Array, Array, Array | None]:
        """Times ``(k,)``, positions ``(k, n)`` and, where given, velocities of what may begin now.

        Raises:
            RefusedTrajectoryError: It is none for these joints, or beyond their limits.
        """
        times, positions, velocities = self._checked(trajectory)
        here, _ = self.setpoint(now)
        way = np.abs(np.diff(positions, axis=0, prepend=here[None]))
        rate = way / np.diff(times, prepend=0.0)[:, None]
        if np.any(rate > FASTER * self._speed + _SLACK):
            k = int(np.argmax(np.max(rate / self._speed, axis=0)))
            fast = float(np.max(rate[:, k]))
            raise RefusedTrajectoryError(
                f"{self.joints[k]} would have to move at {fast:.3g}, faster than it can"
            )
        return times, positions, velocities

    def _checked(self, trajectory: Trajectory) -> tuple[Array, Array, Array | None]:
        """Times ``(k,)``, positions and velocities ``(k, n)`` in the controller's order of joints."""
        n, k = len(self.joints), len(trajectory.positions)
        if sorted(trajectory.joints) != sorted(self.joints):
            raise RefusedTrajectoryError(
                f"names {len(trajectory.joints)} joints, not those of this controller"
            )
        if not 1 <= k <= MOST_POINTS:
            raise RefusedTrajectoryError(f"{k} points; there should be 1 to {MOST_POINTS}")
        order = [list(trajectory.joints).index(name) for name in self.joints]
        if len(trajectory.times) != k or len(trajectory.velocities) != k:
            found = f"{len(trajectory.velocities)} velocities and {len(trajectory.times)} times"
            raise RefusedTrajectoryError(f"{k} points, {found}")
        times = np.asarray(trajectory.times, float)
        if not np.all(np.diff(times, prepend=0.0) > 0.0) or not times[-1] <= LONGEST:
            raise RefusedTrajectoryError(f"times should rise from above 0 to at most {LONGEST:g} s")
        positions = _matrix(trajectory.positions, n, "positions")[:, order]
        given = [len(v) for v in trajectory.velocities]
        velocities = None
        if any(given):
            velocities = _matrix(trajectory.velocities, n, "velocities")[:, order]
            if np.any(np.abs(velocities) > FASTER * self._speed + _SLACK):
                raise RefusedTrajectoryError("a velocity is beyond what the joint can do")
            if np.any(np.abs(velocities[-1]) > _SLACK):
                raise RefusedTrajectoryError("it does not end at rest")
        outside = (positions < self._lower - _SLACK) | (positions > self._upper + _SLACK)
        if np.any(outside):
            joint = int(np.argmax(np.any(outside, axis=0)))
            raise RefusedTrajectoryError(f"{self.joints[joint]} would leave its range")
        return times, positions, velocities

    def stop(self, now: float, acceleration: Array) -> None:
        """Come to stand as fast as the joints may ``(n,)``."""
        here, speed = self.setpoint(now)
        braking = max(float(np.max(np.abs(speed) / acceleration)), 1e-3)
        rest = np.clip(here + speed * braking / 2.0, self._lower, self._upper)
        self._times = np.array([0.0, braking])
        self._positions = np.stack([here, rest])
        self._velocities = np.stack([speed, np.zeros_like(speed)])
        self._linear, self._began = False, now

    def setpoint(self, now: float) -> tuple[Array, Array]:
        """Position and velocity ``(n,)`` of an instant."""
        t = now - self._began
        k = int(np.searchsorted(self._times, t, side="right"))
        if k >= len(self._times):
            return self._positions[-1], np.zeros(len(self.joints))
        if k == 0:
            return self._positions[0], self._velocities[0]
        t0, t1 = self._times[k - 1], self._times[k]
        p0, p1 = self._positions[k - 1], self._positions[k]
        span = t1 - t0
        s = (t - t0) / span
        if self._linear:
            return p0 + s * (p1 - p0), (p1 - p0) / span
        m0, m1 = self._velocities[k - 1] * span, self._velocities[k] * span
        # Cubic Hermite polynomial.
        position = (
            (2 * s**3 - 3 * s**2 + 1) * p0
            + (s**3 - 2 * s**2 + s) * m0
            + (3 * s**2 - 2 * s**3) * p1
            + (s**3 - s**2) * m1
        )
        velocity = (
            (6 * s**2 - 6 * s) * p0
            + (3 * s**2 - 4 * s + 1) * m0
            + (6 * s - 6 * s**2) * p1
            + (3 * s**2 - 2 * s) * m1
        ) / span
        return position, velocity

    def ends(self) -> float:
        """When the set-point comes to stand."""
        return self._began + float(self._times[-1])


def _matrix(rows: Sequence[Sequence[float]], n: int, what: str) -> Array:
    """``(k, n)`` finite numbers."""
    if any(len(row) != n for row in rows):
        raise RefusedTrajectoryError(f"{what}: a point has not {n} numbers")
    matrix = np.array([list(row) for row in rows], float)
    if not np.all(np.isfinite(matrix)):
        raise RefusedTrajectoryError(f"{what}: not every number is finite")
    return matrix
