"""How near an arm comes to tool poses, without looking for joints: a map of where its tool can be.

Looking for joints that there are not takes longest. Tool poses of random postures say at once which of
thousands of poses are worth that (after the capability map of F. Zacharias, C. Borst and G. Hirzinger,
"Capturing robot workspace structure: representing robot capabilities", IROS 2007). The first joint turns all
of them about its own axis, which is upright here: so they are compared turned ahead.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.arm import arm_of
from bt_tasksim.robot.description import RobotDescription

_POSTURES = 60_000
"""Postures that are drawn, in 0.4 s once: of 3,000 grasps of a cup that is to come onto a high tower 1 of 100
can do so, and some of these are among the first 1 of 100 then."""
BEYOND = 0.6
"""How far a tool pose is from those of the map of which no joints are looked for: of 4,000 random postures of
each of the three shipped arms 1 in 1,000 is farther than 0.62, and of hands that point down or ahead near the
edge of what an arm reaches none is farther than 0.47."""
_MARGIN = 0.02
"""Metres beyond all that random postures reach at a height that an arm may reach still."""
_LAYER = 0.02
"""Height in metres of the layers in which that is looked up."""
_METRES = 0.25
"""Metres aside of a pose that count like one radian beside it."""


class ReachMap:
    """Where the tool of one arm can be.

    Args:
        robot: The robot.
    """

    def __init__(self, robot: RobotDescription) -> None:
        arm, rng = arm_of(robot), np.random.default_rng(1)
        lower, upper = np.maximum(robot.arm_lower, -np.pi), np.minimum(robot.arm_upper, np.pi)
        drawn = rng.uniform(lower, upper, (_POSTURES, len(robot.arm_joints)))
        found = _ahead(np.array([arm.tool(q) for q in drawn]))
        # A quaternion and its opposite are one rotation.
        opposite = found * np.array([1.0, 1.0, -1.0, -1.0, -1.0, -1.0])
        self._tree = cKDTree(np.concatenate([found, opposite]))
        away, layer = found[:, 0] * _METRES, np.floor(found[:, 1] * _METRES / _LAYER).astype(int)
        self._lowest = int(layer.min())
        self._away = np.zeros(int(layer.max()) - self._lowest + 1)
        np.maximum.at(self._away, layer - self._lowest, away)

    def far(self, tools: Array) -> Array:
        """How far ``(k,)`` tool poses ``(k, 7)`` are from one that the arm can have, some radians."""
        found: Array = self._tree.query(_ahead(tools))[0]
        return found

    def beyond(self, tools: Array, leans: float = 0.0) -> Array:
        """Which ``(k,)`` of tool poses ``(k, 7)`` the arm surely cannot have.

        Args:
            tools: The poses.
            leans: Radians by which the tool may be turned from them.
        """
        layer = np.floor(tools[:, 2] / _LAYER).astype(int) - self._lowest
        inside = (layer >= 0) & (layer < len(self._away))
        most = np.where(inside, self._away[np.clip(layer, 0, len(self._away) - 1)], 0.0)
        found: Array = np.hypot(tools[:, 0], tools[:, 1]) > most + _MARGIN
        found[~found] = self.far(tools[~found]) > BEYOND + leans
        return found


def reach_of(robot: RobotDescription) -> ReachMap:
    """The map of a robot's arm, made once."""
    found: ReachMap = robot.derived("reach", ReachMap)
    return found


def _ahead(tools: Array) -> Array:
    """Tool poses ``(k, 7)`` turned ahead: distance, height and rotation ``(k, 6)``, in radians."""
    half = -np.arctan2(tools[:, 1], tools[:, 0]) / 2
    turn = np.stack([np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)], axis=-1)
    rotation = poses.quat_multiply(turn, tools[:, 3:])
    away = np.hypot(tools[:, 0], tools[:, 1])
    return np.column_stack([away / _METRES, tools[:, 2] / _METRES, 2.0 * rotation])
