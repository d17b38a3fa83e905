"""Whether a grasp serves a way that its target goes along from where it is, such as that of a door."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept_nodes.closer import TOUCHING
from bt_tasksim.concept_nodes.grasp_aims import Around, Served
from bt_tasksim.concept_nodes.joint_way import (
    LOOKS,
    SPARE,
    SUPPLE,
    axis_of,
    gone_along,
    keeps_clear,
    pivoted,
    pivots,
)
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.collision import beyond
from bt_tasksim.planning.hand_collision import HandCollisions
from bt_tasksim.planning.reach import reach_of
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.planning.things import Held, Leave
from bt_tasksim.planning.ways import WayFinder

BACK = (0.03, 0.06, 0.09)
"""Metres by which the hand is to be able to draw back at the end of the way; the first alone where there is
next to no room."""
_NOWHERE: Array = np.zeros((0, 7))


class ServedAlong(Served):
    """An aim that leads along a way, see `Aim.along`: the hand keeps its grip, and the arm has to follow."""

    def __init__(self, around: Around, aim: Aim, closer: float) -> None:
        super().__init__(around, aim, aside=False, higher=False)
        self._way, self._closer = aim.poses, closer
        view = around.view
        apart = [around.target, *aim.carried]
        self._hands: dict[float, HandCollisions] = {}
        self._things = view.things(apart, closer=closer)
        self._kept: tuple[bytes, WayFinder] | None = None
        self._finders: dict[float, WayFinder] = {}
        self._back = BACK if closer < TOUCHING else BACK[:1]

    def by(self, goal: Array, hand: Array, turns: Sequence[float] = ()) -> bool:
        """Whether the arm may be at the ends of the way; `goes_on` says whether it goes along."""
        return any(self._reaches(goal, hand, pivot) for pivot in self._pivots(goal))

    def _reaches(self, goal: Array, hand: Array, pivot: float) -> bool:
        tools, finder = self._along(goal, pivot), self._finder(goal, hand, pivot)
        return all(bool(finder.ends(tool[None]).reached[0]) for tool in (tools[-1], tools[len(tools) // 2]))

    def tools(self, goal: Array, hand: Array) -> Array:
        """Tool poses ``(k, 7)`` along the way; none where the hand would touch something there."""
        return next((self._along(goal, p) for p in self._pivots(goal) if self._room(goal, hand, p)), _NOWHERE)

    def _room(self, goal: Array, hand: Array, pivot: float) -> bool:
        """Whether the hand alone has room along the way."""
        tools = self._along(goal, pivot)
        closure = float(self._around.view.robot.closure(hand))
        if closure not in self._hands:
            self._hands[closure] = HandCollisions(bodies_of(self._around.view.robot), hand, self._things)
        outside = beyond(self._around.workspace, tools) > 0.0
        self.why = f" (outside the workspace of '{self._around.view.robot.name}')" if outside.any() else ""
        if outside.any() or not self._hands[closure].which_free(tools[1:]).all():
            return False
        return not pivot or self._passes(tools, hand)

    def _passes(self, tools: Array, hand: Array) -> bool:
        """Whether the open hand has room beside a part that turns in it, on its way ``(k, 7)``."""
        view, target = self._around.view, self._around.target
        for k in np.linspace(0, len(tools) - 1, LOOKS).astype(int):
            there = view._replace(objects={target: self._way[k]}).things(closer=TOUCHING, taken=target)
            part = [thing for thing in there if thing.name == target]
            if not HandCollisions(bodies_of(view.robot), hand, part).which_free(tools[k : k + 1]).all():
                return False
        return True

    def goes_on(self, joints: Array, goal: Array, hand: Array) -> bool:
        """Whether the arm goes along from joints ``(n_arm,)`` at a grasp ``(7,)``."""
        return any(self._goes(joints, goal, hand, pivot) for pivot in self._pivots(goal))

    def _goes(self, joints: Array, goal: Array, hand: Array, pivot: float) -> bool:
        if pivot and not self._room(goal, hand, pivot):
            return False
        finder, tools = self._finder(goal, hand, pivot), self._along(goal, pivot)
        spare, supple = (SPARE, SUPPLE) if self._closer < TOUCHING else (0.0, 0.0)
        found = gone_along(finder, joints, tools, spare, supple)
        if found is None:
            return False
        if pivot and not keeps_clear(self._around.view, self._around.target, self._way, found, hand):
            return False
        # At the end the hand is to draw back, and what it held stays there.
        last = np.repeat(tools[-1][None], len(self._back), axis=0)
        back = poses.shifted(last, -np.array(self._back)[:, None] * poses.z_axis(last[:, 3:]))
        after = finder.arm.along(found[-1], back)
        return after is not None and bool(self._alone(hand).collisions.all_free(after))

    def _pivots(self, goal: Array) -> tuple[float, ...]:
        return pivots(self._around.view, self._around.target, goal)

    def _alone(self, hand: Array) -> WayFinder:
        """Ways of the open hand with nothing in it."""
        closure = float(self._around.view.robot.closure(hand))
        if closure not in self._finders:
            view = self._around.view
            self._finders[closure] = WayFinder(view.robot, view.arm, hand, self._things)
        return self._finders[closure]

    def far(self, tools: Array) -> Array:
        """How far ``(k,)`` the arm is from being at the end of the way, see `Served.far`."""
        grips = poses.relative(self._around.now[None], tools)
        reach = reach_of(self._around.view.robot)
        found: Array = reach.far(poses.multiply(self._way[-1][None], grips))
        return found

    def _along(self, goal: Array, pivot: float = 0.0) -> Array:
        view, target = self._around.view, self._around.target
        found = poses.multiply(self._way, poses.relative(self._around.now, goal)[None])
        return pivoted(found, axis_of(view, target), pivot) if pivot else found

    def _finder(self, goal: Array, hand: Array, pivot: float) -> WayFinder:
        key = goal.tobytes() + hand.tobytes() + bytes([pivot > 0.0])
        if self._kept is None or self._kept[0] != key:
            view, target = self._around.view, self._around.target
            held = Held(target, poses.relative(goal, self._around.now), pieces_of(view.model(target)))
            leave = Leave(held=self._aim.supports)
            carried = (None, None) if pivot else (held, leave)
            self._kept = key, WayFinder(view.robot, view.arm, hand, self._things, *carried)
        return self._kept[1]
