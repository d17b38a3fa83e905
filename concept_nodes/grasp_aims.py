"""What is done with an object after it is grasped, and whether a grasp serves that, too."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept_nodes.closer import HIGHER
from bt_tasksim.concept_nodes.holding import HOLDING
from bt_tasksim.concept_nodes.turning import led
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.arm import FULL, LEANS, SWAYS
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.collision import beyond, bounds
from bt_tasksim.planning.hand_collision import HandCollisions
from bt_tasksim.planning.reach import reach_of
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.planning.things import Held, Leave
from bt_tasksim.planning.ways import WayFinder

STILL = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
ABOUT = 12
"""Poses in what follows by which it is judged whether the arm comes near them."""


class Around:
    """What stands around where the target is brought, for all that a grasp has to serve.

    Attributes:
        workspace: Corners ``(2, 3)`` of where the tool may be, see `bounds`.
    """

    def __init__(self, view: WorldView, target: str, closer: float) -> None:
        self.view, self.target = view, target
        self.things = view.things([target, *view.contents(target)], closer=closer)
        self.now = view.objects[target]
        self.workspace = bounds(view.robot, view.tool)
        self._hands: dict[float, HandCollisions] = {}
        self._asked: tuple[bytes, float] | None = None
        self._finders: dict[frozenset[str], WayFinder] = {}

    def alone(self, hand: Array) -> HandCollisions:
        """The open hand where the object is to be, without the object, which is looked at by itself."""
        closure = float(self.view.robot.closure(hand))
        if closure not in self._hands:
            self._hands[closure] = HandCollisions(bodies_of(self.view.robot), hand, self.things)
        return self._hands[closure]

    def finder(self, goal: Array, hand: Array, supports: frozenset[str]) -> WayFinder:
        """Ways with the target as a hand holds it that took it at a tool pose ``(7,)``."""
        asked = goal.tobytes(), float(self.view.robot.closure(hand))
        if asked != self._asked:
            self._asked, self._finders = asked, {}
        if supports not in self._finders:
            view, grip = self.view, poses.relative(goal, self.now)
            held, leave = view.held(self.target, grip), Leave(held=supports)
            self._finders[supports] = WayFinder(view.robot, view.arm, hand, self.things, held, leave)
        return self._finders[supports]


class Served:
    """An aim that a grasp has to serve.

    Attributes:
        words: What is done.
        screens: Poses that are far from all that the arm can have are left out beforehand, see `reach`: worth
            its map where many grasps are asked.
        why: Why the arm can have none of those that were asked about last, to be said behind the words.
    """

    def __init__(self, around: Around, aim: Aim, aside: bool, higher: bool) -> None:
        self._around, self._aim = around, aim
        ends = aim.poses
        if aside and aim.aside is not None and len(aim.aside):
            ends, self._aim = aim.aside, aim._replace(onwards=None)
        falls = (0.0, *HIGHER) if higher and not aim.on_the_way and aim.onwards is None else (0.0,)
        self._poses = np.concatenate([poses.shifted(ends, np.array([0.0, 0.0, above])) for above in falls])
        self.words = aim.words
        full = len(around.view.arm) >= FULL
        self._leans = LEANS if full or not aim.on_the_way else SWAYS
        self.screens, self.why = False, ""
        self._asked, self._tools = (b"", b""), np.zeros((0, 7))
        self._onwards = np.zeros((0, 0, 7))  # tool poses from each of those on

    def by(self, goal: Array, hand: Array, turns: Sequence[float] = ()) -> bool:
        """Whether a grasp at a tool pose ``(7,)`` serves it, also turned about the tool's x axis.

        The hand's joints ``(n_hand,)`` are those with which it comes: so it is going to be when it lets go.
        """
        around, tools = self._around, self.tools(goal, hand)
        if not len(tools):
            return False
        alone = around.alone(hand)
        finder = around.finder(goal, hand, frozenset(self._aim.supports))

        def reached(tool: Array) -> bool:
            return bool(finder.ends(tool[None], leans=self._leans).free[0])

        def turned(tool: Array) -> bool:
            others = [_turned(tool, angle) for angle in turns]
            return all(alone.free(other) and reached(other) for other in others)

        if self._aim.onwards is None:
            return any(reached(tool) and turned(tool) for tool in tools)
        goes_on = zip(tools, self._onwards, strict=True)
        return any(turned(tool) and led(finder, tool, on, self._leans) is not None for tool, on in goes_on)

    def goes_on(self, joints: Array, goal: Array, hand: Array) -> bool:
        """Whether the arm goes on from joints ``(n_arm,)`` at a grasp ``(7,)``."""
        return True

    def tools(self, goal: Array, hand: Array) -> Array:
        """Tool poses ``(k, 7)`` at which it is served where the hand alone touches nothing, see `by`."""
        asked = goal.tobytes(), hand.tobytes()
        if asked != self._asked:
            around = self._around
            grip = poses.relative(around.now, goal)
            every = poses.multiply(self._possible, grip[None])
            which = np.flatnonzero(beyond(around.workspace, every) == 0.0)
            some, self.why = len(every), ""
            if some and not len(which):
                self.why = f" (outside the workspace of '{around.view.robot.name}')"
            elif self.screens and some:
                which = which[~reach_of(around.view.robot).beyond(every[which], self._leans)]
                self.why = "" if len(which) else " (out of reach)"
            which = which[around.alone(hand).which_free(every[which])]
            self._asked, self._tools = asked, every[which]
            if self._aim.onwards is not None:
                on = self._aim.onwards[self._which[which]]
                self._onwards = poses.multiply(on, grip[None, None])
        return self._tools

    def far(self, tools: Array) -> Array:
        """How far ``(k,)`` the arm is from being there with grasps ``(k, 7)``, see `ReachMap.far`."""
        grips = poses.relative(self._around.now[None], tools)
        some = self._possible[:: max(1, len(self._possible) // ABOUT)]
        reach = reach_of(self._around.view.robot)
        far = [reach.far(poses.multiply(pose[None], grips)) for pose in some]
        return np.min(far, axis=0) if far else np.zeros(len(tools))

    @property
    def _possible(self) -> Array:
        """Poses ``(k, 7)`` of the aim in which the object alone touches nothing, whoever holds it."""
        found: Array = self._poses[self._which]
        return found

    @cached_property
    def _which(self) -> Array:
        """The numbers ``(k,)`` of those poses."""
        view, things, target = self._around.view, self._around.things, self._around.target
        alone = Held(target, STILL, pieces_of(view.model(target)))
        leave = Leave(held=self._aim.supports)
        object_ = HandCollisions(bodies_of(view.robot), None, things, alone, leave)
        return np.flatnonzero(object_.which_free(self._poses))


def aims_of(view: WorldView, target: str, later: Sequence[Any]) -> list[Aim]:
    """What is done with the target until it is let go.

    Args:
        view: The world.
        target: The object.
        later: The concepts that come after the grasp.
    """
    found: list[Aim] = []
    for model in later:
        if getattr(model, "actor", None) != target:
            continue
        aim = model.aim(view)
        if aim is not None:
            found.append(aim)
        if HOLDING in model.ends:
            break
    return found


def goes_aside(aims: Sequence[Aim]) -> bool:
    """Whether a target may be put down a little aside of where it should stand, see `Aim.aside`."""
    return any(aim.aside is not None and len(aim.aside) > 0 for aim in aims)


def _turned(tool: Array, angle: float) -> Array:
    """A tool pose ``(7,)`` turned about its own x axis, radians."""
    half = angle / 2
    turn = np.array([np.cos(half), np.sin(half), 0.0, 0.0])
    return np.concatenate([tool[:3], poses.quat_multiply(tool[3:], turn)])
