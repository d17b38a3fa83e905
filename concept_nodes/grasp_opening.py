"""A hand at a grasp among what stands around: as wide open as it comes, and when it has closed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from bt_tasksim.concept_nodes.closer import CLOSER, TOUCHING, VERY_CLOSE
from bt_tasksim.concept_nodes.view import WorldView, nearly
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.collision import OWN
from bt_tasksim.planning.hand_collision import HandCollisions
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.planning.things import Leave, Touch
from bt_tasksim.planning.ways import WayFinder
from bt_tasksim.robot.description import RobotDescription

ASIDE = (0.004, 0.003)
"""Metres across and along the closing axis by which a hand should be able to come beside where it is meant
to: estimates are wrong by some millimetres, and a mesh may have arms or a rim next to where it is held. Where
there is not so much room a share of it."""
TIGHT = 0.008
"""Metres beside where it is meant to be at which a hand with little room would touch something: four times
the standard deviation of good estimates, since an arm is beside its path, too."""


WIDTHS = 0.004
"""Metres between the widths for which it is looked where fingers are when they have closed."""


class Opening:
    """A hand in one world, open so far.

    Args:
        view: The world.
        target: What it takes.
        hand: Joints ``(n_hand,)``.
        close: It comes closer to things than usual.
        beside: Share of `ASIDE`.

    Attributes:
        hand: The joints.
        closure: How far they are closed.
    """

    def __init__(
        self, view: WorldView, target: str, hand: Array, close: bool = False, beside: float = 1.0
    ) -> None:
        self._view, self._target, self._close = view, target, close
        self._aside = [beside * far for far in ASIDE]
        self._closer, self._own = (VERY_CLOSE, 0.0) if close else (CLOSER, OWN)
        self.hand, self.closure = hand, float(view.robot.closure(hand))

    @cached_property
    def coming(self) -> WayFinder:
        """Ways to where the straight approach begins."""
        return self._view.finder(hand=self.hand, closer=CLOSER if self._close else 0.0)

    @cached_property
    def deep(self) -> WayFinder:
        """Ways of a hand that comes as deep as the robot's file says, whatever of it touches then."""
        return self._view.finder(
            hand=self.hand, closer=self._closer, taken=self._target, palm=False, own=self._own
        )

    @cached_property
    def beside(self) -> WayFinder:
        """Ways of a hand that stays clear of what it takes, but for its fingers."""
        leave = self._leave
        return self._view.finder(
            hand=self.hand, closer=self._closer, taken=self._target, leave=leave, own=self._own
        )

    @cached_property
    def alone(self) -> HandCollisions:
        """The hand by itself."""
        things = self._view.things(closer=self._closer, taken=self._target)
        return HandCollisions(bodies_of(self._view.robot), self.hand, things, leave=self._leave)

    @cached_property
    def _leave(self) -> Leave:
        """Fingers close on what is taken, and nothing but them comes near it: see `WorldView.things`."""
        robot = self._view.robot
        bodies = bodies_of(robot)
        fingers = {link for tip in robot.tips for link in tip.links}
        fingers |= {link for link, moves in zip(bodies.links, bodies.fingers, strict=True) if moves}
        return Leave(pairs={(link, nearly(self._target)) for link in fingers})

    def free(self, goal: Array) -> bool:
        """Whether the hand alone touches nothing at a tool pose ``(7,)``, and a little beside it, either."""
        if not self.alone.free(goal):
            return False
        return not any(self._aside) or bool(self.alone.which_free(_beside(goal, *self._aside)).all())

    def tight(self, goal: Array) -> bool:
        """Whether it has little room at a tool pose ``(7,)``, beside the object and what else is around."""
        things = self._view.things(closer=TOUCHING, taken=self._target, palm=False)
        hand = HandCollisions(bodies_of(self._view.robot), self.hand, things)
        return not hand.which_free(_beside(goal, TIGHT, TIGHT)).all()


class Closed:
    """The fingers of a hand in one world when they have closed.

    An open hand may have room where they have none: of a ring that lies over the edge of a board one finger
    comes below, and meets the board as it closes.

    Args:
        view: The world.
        target: What it takes.
        close: It comes closer to things than usual.
    """

    def __init__(self, view: WorldView, target: str, close: bool = False) -> None:
        self._view, self._target, self._closer = view, target, VERY_CLOSE if close else CLOSER
        self._hands: dict[int, HandCollisions] = {}

    def touch(self, goal: Array, width: float) -> Touch | None:
        """What they touch beside the target, which is ``width`` metres wide, at a tool pose ``(7,)``."""
        number = math.ceil(width / WIDTHS)
        if number not in self._hands:
            robot, things = self._view.robot, self._view.things([self._target], closer=self._closer)
            hand = evenly_opened(robot, number * WIDTHS)
            self._hands[number] = HandCollisions(bodies_of(robot), hand, things)
        return self._hands[number].first(goal)


def evenly_opened(robot: RobotDescription, wide: float) -> Array:
    """Joints ``(n_hand,)`` of a hand that is open so many metres, where its fingers part evenly."""
    return robot.hand_position(np.array([1.0 - min(1.0, wide / robot.opening)]))


def wide_along(view: WorldView, target: str, axis: Array) -> float:
    """How wide an object is along a direction ``(3,)``, metres."""
    pose = view.objects[target]
    corners: Sequence[Array] = [
        poses.transform(pose, piece) @ axis for piece in pieces_of(view.model(target))
    ]
    every = np.concatenate(corners)
    return float(every.max() - every.min())


def _beside(tool: Array, across: float, along: float) -> Array:
    """Tool poses ``(4, 7)`` beside one, so many metres across the closing axis and along it, both ways."""
    aside = poses.to_matrix(tool[3:])[:, :2].T * np.array([[across], [along]])
    found = np.repeat(tool[None], 4, axis=0)
    found[:, :3] += np.concatenate([aside, -aside])
    return found
