"""Whether an arm, its hand and what it holds touch anything, for given joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.planning.bodies import RobotBodies
from bt_tasksim.planning.lines import halves
from bt_tasksim.planning.pairs import Pairs
from bt_tasksim.planning.things import Held, Leave, Thing, Touch

OWN = 0.002
"""Metres: bodies have skins of half a millimetre in physics, and arms lag by some. An SO-100 that took a cube
near its base with its jaw a millimetre from its own arm pressed on that with 180 N."""


class Collisions:
    """A robot among things.

    Args:
        bodies: The robot's.
        hand: Positions ``(n_hand,)`` of the hand's joints.
        things: What stands around.
        held: What is in the hand, if anything.
        leave: What may touch.
        own: Metres that the robot's own bodies keep from each other.
    """

    def __init__(
        self,
        bodies: RobotBodies,
        hand: Array,
        things: Sequence[Thing],
        held: Held | None = None,
        leave: Leave | None = None,
        own: float = OWN,
    ) -> None:
        self._bodies, self._q = bodies, bodies.configuration(bodies.robot.rest, hand)
        self._arm = bodies.order[: len(bodies.robot.arm_joints)]
        self._pairs = Pairs(bodies.model, bodies.shapes.copy(), bodies.links, leave)
        inside = self._pairs.add_held(held, bodies.tool_joint, bodies.tool_placement)
        self._pairs.compare(map(tuple, bodies.apart.tolist()), own)
        arm = [
            i
            for i in np.flatnonzero(~bodies.hand).tolist()
            if bodies.shapes.geometryObjects[i].parentJoint != bodies.tool_joint
        ]
        self._pairs.compare((i, k) for i in arm for k in inside)
        moves, hands = (np.flatnonzero(which).tolist() for which in (bodies.moves, bodies.hand))
        self._pairs.stand(things, moves, hands, inside)

    def free(self, arm: Array) -> bool:
        """Nothing touches with the arm's joints at ``arm (n_arm,)``."""
        return self._pairs.free(self._at(arm))

    def all_free(self, arms: Array) -> bool:
        """Nothing touches at any of ``arms (n, n_arm)``; the middle ones are asked first."""
        return all(self.free(q) for q in halves(arms))

    def touches(self, arm: Array) -> list[Touch]:
        """What touches with the arm's joints at ``arm (n_arm,)``."""
        return self._pairs.touches(self._at(arm))

    def keys(self, arm: Array) -> list[Touch]:
        """The same by keys of things, see `Thing.key`."""
        return self._pairs.keys(self._at(arm))

    def tool_rotation(self) -> Array:
        """The tool's rotation ``(3, 3)`` for the joints that were asked about last."""
        joint = self._pairs.placement(self._bodies.tool_joint)
        found: Array = joint.rotation @ self._bodies.tool_placement.rotation
        return found

    def _at(self, arm: Array) -> Array:
        """Pinocchio's ``q``."""
        self._q[self._arm] = arm
        return self._q
