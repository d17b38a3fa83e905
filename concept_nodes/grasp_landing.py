"""How the palm of a hand that reaches down beside something tall comes to its top, which it may meet.

Its fingers are only a few millimetres longer than a grasp is deep, and sizes are estimates: where they were
up to 10 % off, a palm that came on at the reference motion's speed pressed 60 to 74 N in one control period,
in 8 of 50 grasps. Flat on a top it cannot give way by turning, and presses 50 N more for each 0.4 mm.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.grasp_features import ALONG, CAREFUL, EAGER, SCALE
from bt_tasksim.concept_nodes.grasp_memory import GraspMemory
from bt_tasksim.concept_nodes.limits import gentler
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.planning.reference_motion import position

ZONE = 0.012
"""Metres before the grasp from which on a palm may meet the top."""
NEARLY = 0.9
"""Share of the depth of a grasp from which on, by what is believed, an object reaches up to the palm."""
SPEED = 0.025
"""Metres a second at which it comes on there: at 0.05, 5 of these 50 still pressed too hard."""
FELT = 2.0
"""Newtons against the approach from which on it has landed."""
LIFTED = 0.0008
"""Metres by which it is then lifted in a control period, until it presses no more."""
STANDS = -CAREFUL / EAGER
"""The action at which the reference motion stands still."""
SLOWEST = 0.05
"""The least share of its own speed at which the reference motion goes on otherwise."""
_MOVED = 1e-4
"""Metres by which it is above the middle of an action once it has landed, at least."""


class Landing(NamedTuple):
    """What the palms of ``N`` worlds do.

    Attributes:
        near: Whether they may meet something.
        pace: The time scaling to ask for there, as an action.
        back: Metres by which they go back against the reference motion in the next control period: as far as
            that goes on, once they have landed.
        goes: Metres that the reference motion goes in a control period at its own speed.
    """

    near: Array
    pace: Array
    back: Array
    goes: Array


def reaches_palm(half: Array, depth: float) -> Array:
    """Whether ``(N,)`` an object that reaches ``half`` metres along the approach may meet the palm.

    Args:
        half: Half its extent ``(N,)`` along the approach, metres, as it is believed to be.
        depth: How far the hand reaches down beside it, metres.
    """
    return half > NEARLY * depth


def landing(seen: Seen, memory: GraspMemory) -> Landing:
    """What the palm does where it may meet something: it comes slowly, and lands once."""
    xp = array_namespace(memory.middle)
    near = poses.norm(seen.tool[:, :3] - memory.goal[:, :3]) < ZONE
    near = memory.lands & near & (memory.closing < 0.0)
    presses = near & (seen.wrench[:, 2] < -FELT)
    has_landed = near & (memory.offset[:, ALONG] < memory.middle[:, ALONG] * SCALE[ALONG] - _MOVED)
    period = seen.world.control_period
    slow = SPEED * period * gentler(seen.tool)
    most = xp.where(has_landed, xp.full_like(slow, LIFTED), slow)
    now = seen.elapsed - memory.delay
    goes = poses.norm(position(memory.path, now + period) - position(memory.path, now))
    pace = paced(goes, most)
    held = xp.where(has_landed, xp.minimum(most, goes), xp.zeros_like(goes))
    return Landing(
        near,
        xp.where(presses, xp.full_like(pace, STANDS), pace),
        xp.where(presses, xp.full_like(held, LIFTED), held),
        goes,
    )


def paced(goes: Array, most: Array) -> Array:
    """The time scaling ``(N,)``, as an action, at which a motion goes no farther than it may.

    Args:
        goes: Metres ``(N,)`` that it goes in a control period at its own speed.
        most: Metres ``(N,)`` that it may.
    """
    share = poses.clip(most / poses.clip(goes, 1e-9, math.inf), SLOWEST, 1.0)
    return (share - CAREFUL) / EAGER
