"""Tasks that take a part of furniture along its joint onto a stop, which the wrist feels."""

from __future__ import annotations

import math

from bt_tasksim.concept.parameters import Newtons
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.joint_force import force_against, reach_of
from bt_tasksim.concept_nodes.on_joint import JointMemory, OnJoint
from bt_tasksim.core import poses
from bt_tasksim.core.joints import NEAR_STOP
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.planning.reference_motion import position

SLOWLY = 0.016
"""Metres of the hand's way before a stop from which on it goes no faster than `GENTLY`."""
GENTLY = 0.008
"""Metres per second: what meets its stop in the hand of a stiff arm presses with up to 20 N more with every
half millimetre that this goes on."""
BRAKES = 0.1
"""m/s^2 by which it comes to go so slowly."""
SEARCHES = 0.015
"""Metres of the hand's way beyond the path's end on which it looks for a stop that it has not felt: what the
hand holds may have slipped in it, and where a part stands is known from there."""
FELT, FIRMLY = 2, 1.5
"""Ticks in a row for which a stop must be felt, and how many times `press` are felt at once."""


class ToStop(OnJoint):
    """A task in which ``target`` is taken onto a stop of its joint, and done when that is felt."""

    press: Newtons

    @property
    def stops(self) -> int:
        """See `OnJoint.stops`."""
        raise NotImplementedError

    def done(self, seen: Seen, memory: JointMemory) -> Array:
        """The stop is felt, or is not there where it was looked for; then see `OnJoint.done`."""
        searched = self.stops * memory.further * reach_of(seen, self.target) >= SEARCHES
        return (super().done(seen, memory) & searched) | (self._felt(seen, memory) >= FELT)

    def _goes_on(self, seen: Seen, memory: JointMemory) -> Array:
        """See `OnJoint._goes_on`; as slowly as before its stop at least, and no more once that is felt."""
        missing = self.stops * super()._goes_on(seen, memory)
        on = self.stops * array_namespace(missing).maximum(missing, GENTLY / reach_of(seen, self.target))
        return array_namespace(on).where(memory.felt > 0, 0.0 * on, on)

    def _share(self, seen: Seen, memory: JointMemory) -> Array:
        """See `OnJoint._share`; slowly near the stop, and not at all once that is felt."""
        xp, period, share = (
            array_namespace(seen.tool),
            seen.world.control_period,
            super()._share(seen, memory),
        )
        here, next_one = (position(memory.path, memory.progress + dt) for dt in (0.0, period))
        ahead = poses.clip(poses.norm(next_one - here), 1e-9, math.inf)
        end = poses.multiply(self._law(seen).pose(memory.goal), poses.inverse(memory.grip))
        left = poses.clip(poses.norm(end[:, :3] - here) - SLOWLY, 0.0, math.inf)
        before = poses.dot(end[:, :3] - here, next_one - here) > 0.0
        left = xp.where(before, left, xp.zeros_like(left))
        most = xp.sqrt(GENTLY**2 + 2.0 * BRAKES * left)
        share = xp.minimum(share, poses.clip(most * period / ahead, 0.0, 1.0))
        return xp.where(memory.felt > 0, xp.zeros_like(share), share)

    def _felt(self, seen: Seen, memory: JointMemory) -> Array:
        """See `OnJoint._felt`; a firm one is enough."""
        xp, nothing = array_namespace(seen.tool), 0 * memory.felt
        against = force_against(seen, self.target, self._ahead(seen, memory))
        at_stop = abs(self._value(seen) - memory.goal) < NEAR_STOP[self.turns]
        ticks = xp.where(against > FIRMLY * self.press, nothing + FELT, nothing + 1)
        return xp.where(at_stop & (against > self.press), memory.felt + ticks, nothing)
