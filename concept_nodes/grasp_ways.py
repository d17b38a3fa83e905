"""Whether a grasp serves a way that its target goes along from where it is, such as that of a door."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept_nodes.closer import TOUCHING
from bt_tasksim.concept_nodes.grasp_aims import Around, Served
from bt_tasksim.concept_nodes.joint_way import SPARE, gone_along
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
        tools, finder = self._along(goal), self._finder(goal, hand)
        return all(bool(finder.ends(tool[None]).reached[0]) for tool in (tools[-1], tools[len(tools) // 2]))

    def tools(self, goal: Array, hand: Array) -> Array:
        """Tool poses ``(k, 7)`` along the way; none where the hand would touch something there."""
        tools = self._along(goal)
        closure = float(self._around.view.robot.closure(hand))
        if closure not in self._hands:
            self._hands[closure] = HandCollisions(bodies_of(self._around.view.robot), hand, self._things)
        outside = beyond(self._around.workspace, tools) > 0.0
        self.why = f" (outside the workspace of '{self._around.view.robot.name}')" if outside.any() else ""
        if outside.any() or not self._hands[closure].which_free(tools[1:]).all():
            return tools[:0]
        return tools

    def goes_on(self, joints: Array, goal: Array, hand: Array) -> bool:
        """Whether the arm goes along from joints ``(n_arm,)`` at a grasp ``(7,)``."""
        finder, tools = self._finder(goal, hand), self._along(goal)
        found = gone_along(finder, joints, tools, SPARE if self._closer < TOUCHING else 0.0)
        if found is None:
            return False
        # At the end the hand is to draw back, and what it held stays there.
        last = np.repeat(tools[-1][None], len(self._back), axis=0)
        back = poses.shifted(last, -np.array(self._back)[:, None] * poses.z_axis(last[:, 3:]))
        after = finder.arm.along(found[-1], back)
        return after is not None and bool(self._alone(hand).collisions.all_free(after))

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

    def _along(self, goal: Array) -> Array:
        found: Array = poses.multiply(self._way, poses.relative(self._around.now, goal)[None])
        return found

    def _finder(self, goal: Array, hand: Array) -> WayFinder:
        key = goal.tobytes() + hand.tobytes()
        if self._kept is None or self._kept[0] != key:
            view, target = self._around.view, self._around.target
            held = Held(target, poses.relative(goal, self._around.now), pieces_of(view.model(target)))
            leave = Leave(held=self._aim.supports)
            self._kept = key, WayFinder(view.robot, view.arm, hand, self._things, held, leave)
        return self._kept[1]
