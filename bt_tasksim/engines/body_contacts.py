"""Where bodies of a world touch, point by point: for the classes of contact states."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from bt_tasksim.core.poses import Array

Row = tuple[str, str, bool, Array, Array]
"""Names of two bodies, whether one is the robot's, a point and the normal into the first body."""


class BodyContacts(NamedTuple):
    """Contacts of one world at one instant, robot base frame.

    Attributes:
        first: Names ``(n,)`` of bodies: objects, fixtures and the robot's links.
        second: Names ``(n,)`` of those that they touch.
        robot: Booleans ``(n,)``: one of the two is a link of the robot.
        points: Where ``(n, 3)``, metres.
        normals: Unit normals ``(n, 3)`` that point into the first body.
    """

    first: tuple[str, ...]
    second: tuple[str, ...]
    robot: Array
    points: Array
    normals: Array

    @classmethod
    def of(cls, rows: Iterable[Row]) -> BodyContacts:
        """Contacts in an order that depends on them alone."""
        ordered = sorted(rows, key=lambda row: (row[0], row[1], tuple(row[3]), tuple(row[4])))
        return cls(
            tuple(row[0] for row in ordered),
            tuple(row[1] for row in ordered),
            np.array([row[2] for row in ordered], dtype=bool),
            np.array([row[3] for row in ordered], dtype=float).reshape(-1, 3),
            np.array([row[4] for row in ordered], dtype=float).reshape(-1, 3),
        )

    def on(self, name: str, hand: bool = False) -> tuple[Array, Array]:
        """Normals into a body and points ``(k, 3)`` of what touches it.

        Args:
            name: The body.
            hand: What the robot touches it with counts, too.
        """
        first, second = (
            np.array([each == name for each in side], bool) for side in (self.first, self.second)
        )
        counts = (first | second) & (hand | ~self.robot)
        normals = np.where(first[:, None], self.normals, -self.normals)
        return normals[counts], self.points[counts]

    def with_each_other(self, one: str, other: str) -> bool:
        """Two bodies touch."""
        return any({a, b} == {one, other} for a, b in zip(self.first, self.second, strict=True))
