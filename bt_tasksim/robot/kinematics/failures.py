"""Why an arm could not follow its commands, by world: numbers, and the sentence when somebody reads it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from bt_tasksim.core.errors import InputError, UnreachableError


class Reach(IntEnum):
    """How an inverse kinematics ended."""

    REACHED = 0
    UNREACHABLE = 1
    """No posture brings the tool there."""
    SWINGS = 2
    """Only a posture does to which the arm would have to swing while the tool hardly moves."""
    NO_ROTATION = 3
    """The quaternion that was asked for is nowhere near a unit one."""


@dataclass(frozen=True)
class Failures:
    """What became of the tool poses ``(k, 7)`` that were asked for; NumPy arrays, one row a world.

    Attributes:
        robot: The robot's name.
        code: ``(k,)`` of `Reach`.
        goal: ``(k, 7)`` the poses, robot base frame.
        distance: ``(k,)`` metres by which the nearest pose misses.
        angle: ``(k,)`` radians by which the nearest pose misses.
    """

    robot: str
    code: np.ndarray
    goal: np.ndarray
    distance: np.ndarray
    angle: np.ndarray

    @property
    def mask(self) -> np.ndarray:
        """Rows ``(k,)`` that failed."""
        return np.asarray(self.code != Reach.REACHED)

    def __bool__(self) -> bool:
        """A row has failed."""
        return bool(self.code.any())

    def error(self, row: int) -> InputError | None:
        """What a row's failure says, None where it did not fail: an `UnreachableError` with its numbers."""
        code = Reach(int(self.code[row]))
        goal = self.goal[row].tolist()
        if code is Reach.REACHED:
            return None
        if code is Reach.NO_ROTATION:
            return InputError(
                f"a tool pose needs a unit quaternion (w x y z) behind its position, found {goal}"
            )
        distance, angle = float(self.distance[row]), float(self.angle[row])
        how = " without swinging into another posture" if code is Reach.SWINGS else ""
        x, y, z = goal[:3]
        return UnreachableError(
            f"{self.robot} cannot bring its tool to ({x:.3f}, {y:.3f}, {z:.3f}) m{how}: "
            f"the nearest pose misses by {1000 * distance:.1f} mm and {np.rad2deg(angle):.1f} degrees",
            distance,
            angle,
        )
