"""Pick: take a held object off its support."""

from __future__ import annotations

import numpy as np

from bt_tasksim.context import Seen
from bt_tasksim.motion import plan
from bt_tasksim.parameters import Direction, Metres, MetresPerSecond, Newtons, ObjectName
from concept_nodes.carry import Carry, MoveMemory
from concept_nodes.limits import FORCE_LIMIT


class Pick(Carry):
    """Take a held object off what it rests on (breaks its contact: PC to NC).

    Args:
        target: The held object.
        direction: Direction away from the support, robot base frame.
        distance: How far.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    direction: Direction = (0.0, 0.0, 1.0)
    distance: Metres = 0.10
    speed: MetresPerSecond = 0.3
    force_limit: Newtons = FORCE_LIMIT

    default_timeout = 8.0

    def begin(self, seen: Seen) -> MoveMemory:
        """A straight path."""
        goal = seen.tool.copy()
        goal[:3] += self.distance * np.asarray(self.direction)
        return MoveMemory(plan([seen.tool, goal], self.speed, samples=2))
