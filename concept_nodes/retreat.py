"""How an open hand draws back from what it lets go of: straight, as far as that is clear."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.carry import straight_path
from bt_tasksim.concept_nodes.closer import CLOSER, TOUCHING
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array, constant
from bt_tasksim.planning.reference_motion import Path
from bt_tasksim.planning.things import Leave
from bt_tasksim.planning.ways import WayFinder
from bt_tasksim.robot.kinematics.hand import SLIDE, standing_side

SHARES = (1.0, 0.75, 0.5, 0.25)
"""Shares of a retreat that are tried where not all of it is clear."""
LITTLE = 0.1
"""Share of a retreat that does for a hand which lets go: its arm may be nearly as high as it comes."""


class Retreat(NamedTuple):
    """How a hand draws back in one world.

    Attributes:
        away: Displacement ``(3,)`` in all, metres.
        joints: Joints ``(n, n_arm)`` along the way; none where it stays.
        aside: The same for what comes first: a finger that stands still goes away from what it touches.
    """

    away: Array
    joints: Array
    aside: Array


def clear_retreat(
    view: WorldView, hand: Array, distance: float, directions: Sequence[Array], let_go: Collection[str]
) -> Retreat:
    """The first retreat that touches nothing: by direction, and then as far as it is clear.

    Args:
        view: The world.
        hand: The opened hand's joints ``(n_hand,)``.
        distance: How far it is to go, metres.
        directions: Unit vectors ``(3,)`` in which it may go, robot base frame.
        let_go: Objects that it may touch.

    Raises:
        NoWayError: None is clear; says what would be touched.
    """
    for closer in (CLOSER, TOUCHING):
        finder = view.finder(hand=hand, leave=Leave(hand=let_go), closer=closer)
        beside = _beside(finder, view)
        begin = finder.start if beside is None else beside.joints[-1]
        tool = view.tool if beside is None else poses.shifted(view.tool, beside.away)
        for direction in directions:
            for share in SHARES:
                end = poses.shifted(tool, share * distance * direction)
                joints = finder.straight([tool, end], start=begin, leans=finder.leanings[-1])
                if joints is not None:
                    aside = begin[None][:0] if beside is None else beside.joints
                    return Retreat(end[:3] - view.tool[:3], np.concatenate([begin[None], joints]), aside)
    touches = finder.touched(end)
    why = f"{touches[0][0]} would touch {touches[0][1]}" if touches else "the arm cannot follow"
    raise NoWayError(f"the hand cannot draw back by {1000 * SHARES[-1] * distance:.0f} mm: {why}")


def little_retreat(
    view: WorldView, hand: Array, distance: float, directions: Sequence[Array], let_go: Collection[str]
) -> Retreat:
    """A retreat of a hand that lets go where none is clear: a little of one.

    Where not even that is, a finger that stands still goes away from what it touches, and other hands stay.

    Args:
        view: The world.
        hand: The opened hand's joints ``(n_hand,)``.
        distance: How far it was to go, metres.
        directions: Unit vectors ``(3,)`` in which it may go, robot base frame.
        let_go: Objects that it may touch.
    """
    with suppress(NoWayError):
        return clear_retreat(view, hand, LITTLE * distance, directions, let_go)
    finder = view.finder(hand=hand, leave=Leave(hand=let_go), closer=TOUCHING)
    nothing = np.zeros((0, len(view.arm)))
    return _beside(finder, view) or Retreat(np.zeros(3), nothing, nothing)


def retreat_path(seen: Seen, found: Sequence[Retreat], speed: float) -> Path:
    """The tool's paths back, one retreat for each world.

    Args:
        seen: Where the tool is.
        found: How it draws back.
        speed: Its peak speed, m/s.
    """
    goal = poses.shifted(seen.tool, constant(np.array([way.away for way in found]), seen.tool))
    aside = [] if standing_side(seen.robot) is None else [way.aside for way in found]
    return straight_path(seen, goal, speed, [way.joints for way in found], aside)


def _beside(finder: WayFinder, view: WorldView) -> Retreat | None:
    """How a finger that stands still goes away from what it touches; None where none does, or has no room.

    Opened by the other finger alone, a hand takes along what leans on this one when it draws back.
    """
    side = standing_side(view.robot)
    if side is None:
        return None
    away = math.copysign(SLIDE, side) * poses.to_matrix(view.tool[3:])[:, 1]
    joints = finder.straight([view.tool, poses.shifted(view.tool, away)])
    if joints is None:
        return None
    return Retreat(away, np.concatenate([finder.start[None], joints]), joints[:0])
