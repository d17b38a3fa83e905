"""Whether a hand alone would touch anything at a tool pose, whichever way its arm may bring it there.

It is asked before joints are looked for: of hundreds of grasps most are excluded by the hand itself.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.bodies import RobotBodies, bodies_of
from bt_tasksim.planning.pairs import Carrier, Pairs
from bt_tasksim.planning.things import Held, Leave, Thing, Touch
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.models import free_flyer


class HandCollisions:
    """A hand among things.

    Args:
        bodies: The robot's.
        hand: Positions ``(n_hand,)`` of the hand's joints; None: only what is held is looked at.
        things: What stands around.
        held: What is in the hand, if anything.
        leave: What may touch.
    """

    def __init__(
        self,
        bodies: RobotBodies,
        hand: Array | None,
        things: Sequence[Thing],
        held: Held | None = None,
        leave: Leave | None = None,
    ) -> None:
        model, joint, still = _flying(), 1, np.eye(4)
        carriers = {0: Carrier(0, still), joint: Carrier(1, still)}
        self._pairs = Pairs(model, pin.GeometryModel(), (), leave, (), np.empty((0, 4, 4)), carriers)
        own: list[int] = []
        for name, placement, shape, box in () if hand is None else bodies.hand_bodies(hand):
            own += self._pairs.add(name, joint, placement, [shape], box[None])
        inside = self._pairs.add_held(held, joint, pin.SE3.Identity())
        self._pairs.stand(things, own, own, inside)

    def free(self, tool: Array) -> bool:
        """Nothing touches at a tool pose ``(7,)``."""
        return self._pairs.free(free_flyer(tool), lambda: _frames(tool[None]))

    def which_free(self, tools: Array) -> Array:
        """Whether ``(k,)`` nothing touches at tool poses ``(k, 7)``."""
        free: Array = ~self._pairs.near(_frames(tools))
        free[~free] = [self._pairs.clear(free_flyer(tool)) for tool in tools[~free]]
        return free

    def first(self, tool: Array) -> Touch | None:
        """The first of what touches at a tool pose ``(7,)``; None where nothing does."""
        return None if self.free(tool) else next(iter(self.touches(tool)), None)

    def touches(self, tool: Array) -> list[Touch]:
        """What touches at a tool pose ``(7,)``."""
        return self._pairs.touches(free_flyer(tool), _frames(tool[None]))


@cache
def _flying() -> pin.Model:
    """A body that flies wherever it likes; nobody writes to it."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "tool")
    return model


def _frames(tools: Array) -> Array:
    """Placements ``(k, 2, 4, 4)`` of the base and of a tool at poses ``(k, 7)``."""
    found = np.zeros((len(tools), 2, 4, 4))
    found[:] = np.eye(4)
    found[:, 1, :3, :3], found[:, 1, :3, 3] = poses.to_matrix(tools[:, 3:]), tools[:, :3]
    return found


def beyond(robot: RobotDescription) -> float:
    """Metres that both sides of a half closed hand reach beyond the tool's origin, along its approach."""
    found: float = robot.derived("beyond", _beyond)
    return found


def _beyond(robot: RobotDescription) -> float:
    ends: dict[str, float] = {}
    for name, placement, shape in hand_shapes(bodies_of(robot), (robot.hand_open + robot.hand_closed) / 2):
        deepest = float((_corners(shape) @ placement.rotation.T + placement.translation)[:, 2].max())
        ends[name] = max(ends.get(name, -math.inf), deepest)
    tips = [max(ends.get(link, -math.inf) for link in tip.links) for tip in robot.tips]
    return min(max(tips[k] for k in group) for group in robot.opposition)


def _corners(shape: Any) -> Array:
    """Points ``(n, 3)`` in whose hull a shape is: its own corners, or those of its box."""
    if hasattr(shape, "num_points"):
        return np.array([shape.point(k) for k in range(shape.num_points)])
    shape.computeLocalAABB()
    box = shape.aabb_local
    return np.array(list(itertools.product(*zip(box.min_, box.max_, strict=True))))


def hand_pieces(bodies: RobotBodies, hand: Array) -> list[Array]:
    """Corners ``(n, 3)`` of the hand's convex bodies in the tool frame, metres.

    Args:
        bodies: The robot's.
        hand: Positions ``(n_hand,)`` of the hand's joints.
    """
    return [
        _corners(shape) @ placement.rotation.T + placement.translation
        for _, placement, shape in hand_shapes(bodies, hand)
    ]


def hand_shapes(bodies: RobotBodies, hand: Array) -> list[tuple[str, Any, Any]]:
    """Links of the hand, their placements in the tool frame, and their shapes."""
    return [(name, placement, shape) for name, placement, shape, _ in bodies.hand_bodies(hand)]
