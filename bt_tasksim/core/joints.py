"""Parts of furniture that slide or turn: how far they are open, and where they are then.

A joint's value counts from 0, where it is as its fixture gives it, in metres for one that slides and radians
for one that turns. It is shut at its lower limit, which is 0 for most. All laws are for ``N`` joints at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array, array_namespace

SLIDES, TURNS = "slide", "hinge"
KINDS = (SLIDES, TURNS)
SHORTEST = 1e-3
"""The least that a part can go, metres or radians."""
LONGEST = {SLIDES: 2.0, TURNS: 6.0}
"""Metres or radians that a part can go at most; of what turns nearly round, estimates would not tell one end
from the other."""
LEAST_REACH = 0.05
"""Metres from its axis at which, at least, a torque about a joint is taken as a force."""
NEAR_STOP = {False: 0.015, True: math.radians(4.0)}
"""Metres or radians from a stop, by whether it turns, within which what is felt to be stopped is there."""


def check_way(kind: str, limits: tuple[float, float], value: tuple[float, float]) -> None:
    """Check what a part can do.

    Args:
        kind: ``slide`` or ``hinge``.
        limits: Lowest and highest value, m or rad.
        value: Lowest and highest value at the start.

    Raises:
        InputError: The limits are in no order or too far apart, or the part begins beyond them.
    """
    (low, high), unit = limits, "m" if kind == SLIDES else "rad"
    if not low < high:
        raise InputError(f"'limits' should be the lower one first, found {low:g} and {high:g}")
    if high - low < SHORTEST:
        raise InputError(f"'limits' should be at least {SHORTEST:g} {unit} apart, found {high - low:g}")
    if high - low > LONGEST[kind]:
        raise InputError(f"'limits' should be at most {LONGEST[kind]:g} {unit} apart, found {high - low:g}")
    if not low <= value[0] <= value[1] <= high:
        said = f"{value[0]:g}" if value[0] == value[1] else f"{value[0]:g} to {value[1]:g}"
        raise InputError(
            f"'value', how far it is open at the start, should be between {low:g} and {high:g} {unit}, the "
            f"lower one first, found {said}"
        )


@dataclass(frozen=True)
class JointModel:
    """What is known beforehand of the joint by which a part of a fixture moves.

    Attributes:
        kind: ``slide`` or ``hinge``.
        origin: A point ``(3,)`` on its axis, in the part's frame, metres.
        axis: Unit vector ``(3,)`` in the part's frame: the way in which the value grows, or the axis about
            which it does, by the right hand.
        zero: Pose ``(7,)`` of the part in the robot base frame where the value is 0.
        limits: Lowest and highest value, metres or radians.
        sensed: The robot sees how far it is open; else it knows only what its hand has done with it.
        fixture: Name of the fixture whose part it moves.
    """

    kind: str
    origin: tuple[float, float, float]
    axis: tuple[float, float, float]
    zero: tuple[float, ...]
    limits: tuple[float, float]
    sensed: bool = False
    fixture: str = ""

    @property
    def turns(self) -> bool:
        """It turns, and does not slide."""
        return self.kind == TURNS


class Joints(NamedTuple):
    """Joints as arrays; leading dimensions ``(...)``, see `JointModel`.

    Attributes:
        turns: Boolean ``(...)``.
        origin: ``(..., 3)``, metres.
        axis: Unit vectors ``(..., 3)``.
        zero: Poses ``(..., 7)``.
        limits: ``(..., 2)``, metres or radians.
    """

    turns: Array
    origin: Array
    axis: Array
    zero: Array
    limits: Array

    @classmethod
    def of(cls, models: Sequence[JointModel]) -> Joints:
        """Joints ``(n,)`` of models, in NumPy."""
        return cls(
            turns=np.array([model.turns for model in models], bool),
            origin=np.array([model.origin for model in models], float).reshape(-1, 3),
            axis=np.array([model.axis for model in models], float).reshape(-1, 3),
            zero=np.array([model.zero for model in models], float).reshape(-1, 7),
            limits=np.array([model.limits for model in models], float).reshape(-1, 2),
        )

    def way(self, value: Array) -> Array:
        """Motions ``(..., 7)`` of the part in its own frame at 0, by values ``(...)``."""
        xp = array_namespace(self.origin)
        turns = self.turns[..., None]
        rotation = poses.from_rotation_vector(xp.where(turns, self.axis * value[..., None], 0.0 * self.axis))
        turned = self.origin - poses.rotate(rotation, self.origin)
        return xp.concat([xp.where(turns, turned, self.axis * value[..., None]), rotation], axis=-1)

    def pose(self, value: Array) -> Array:
        """Poses ``(..., 7)`` of the part in the robot base frame, by values ``(...)``."""
        return poses.multiply(self.zero, self.way(value))

    def value(self, pose: Array) -> Array:
        """Values ``(...)`` that come nearest to poses ``(..., 7)``, within the limits.

        Where it turns, the value is that of the turn about the axis alone: the middle of the turns that
        bring the part's frame at 0 onto the one given.
        """
        xp = array_namespace(self.origin)
        moved = poses.multiply(poses.inverse(self.zero), pose)
        slid = xp.sum(moved[..., :3] * self.axis, axis=-1)
        swing = 2.0 * xp.atan2(xp.sum(moved[..., 4:] * self.axis, axis=-1), moved[..., 3])
        swing = xp.atan2(xp.sin(swing), xp.cos(swing))
        middle = (self.limits[..., 0] + self.limits[..., 1]) / 2  # the whole turn that is nearest to it
        swing = swing + 2.0 * np.pi * xp.round((middle - swing) / (2.0 * np.pi))
        value = xp.where(self.turns, swing, slid)
        return poses.clip(value, self.limits[..., 0], self.limits[..., 1])

    def shift(self, now: Array, point: Array, moved: Array) -> Array:
        """By how much values grow ``(...)`` when a point that goes with the part is moved.

        Args:
            now: Values ``(...)`` before.
            point: Where the point is ``(..., 3)``, robot base frame.
            moved: Where it comes to be ``(..., 3)``.
        """
        xp = array_namespace(self.origin)
        at = self.pose(now)
        axis = poses.rotate(at[..., 3:], self.axis)
        along = xp.sum((moved - point) * axis, axis=-1)
        centre = poses.transform(at, self.origin)

        def arm(place: Array) -> Array:
            lever = place - centre
            return lever - xp.sum(lever * axis, axis=-1)[..., None] * axis

        a, b = arm(point), arm(moved)
        turn = xp.atan2(xp.sum(poses.cross(a, b) * axis, axis=-1), xp.sum(a * b, axis=-1))
        return xp.where(self.turns, turn, along)

    def arm(self, now: Array, point: Array) -> Array:
        """From the axis ``(..., 3)`` to points ``(..., 3)``, across the axis, robot base frame, metres.

        Args:
            now: Values ``(...)``.
            point: The points, robot base frame.
        """
        at = self.pose(now)
        axis = poses.rotate(at[..., 3:], self.axis)
        lever = point - poses.transform(at, self.origin)
        return lever - poses.dot(lever, axis)[..., None] * axis

    def reach(self, now: Array, point: Array) -> Array:
        """Metres ``(...)`` that a point goes for a metre of what slides, or a radian of what turns.

        Of what turns it is `LEAST_REACH` at least: knobs are held on their axis. The arguments are those of
        `arm`.
        """
        away = poses.clip(poses.norm(self.arm(now, point)), LEAST_REACH, math.inf)
        return array_namespace(away).where(self.turns, away, 0.0 * away + 1.0)

    def force(self, now: Array, point: Array, force: Array, torque: Array) -> Array:
        """What pushes ``(...)`` towards larger values, at a point that goes with the part, N.

        Of what turns it is the torque about the axis, over `reach`.

        Args:
            now: Values ``(...)``.
            point: Where force and torque are told ``(..., 3)``, robot base frame, metres.
            force: ``(..., 3)``, robot base frame, N.
            torque: About the point ``(..., 3)``, robot base frame, Nm.
        """
        at = self.pose(now)
        axis = poses.rotate(at[..., 3:], self.axis)
        about = torque + poses.cross(point - poses.transform(at, self.origin), force)
        turning = poses.dot(about, axis) / self.reach(now, point)
        return array_namespace(turning).where(self.turns, turning, poses.dot(force, axis))
