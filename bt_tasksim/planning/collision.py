"""Whether an arm, its hand and what it holds touch anything, or leave the workspace, for given joints."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import pinocchio as pin

from bt_tasksim.core.poses import Array
from bt_tasksim.planning.bodies import RobotBodies
from bt_tasksim.planning.lines import halves
from bt_tasksim.planning.pairs import Pairs
from bt_tasksim.planning.things import Held, Leave, Thing, Touch
from bt_tasksim.robot.description import RobotDescription

OWN = 0.002
"""Metres: bodies have skins of half a millimetre in physics, and arms lag by some. An SO-100 that took a cube
near its base with its jaw a millimetre from its own arm pressed on that with 180 N."""
INSIDE = 0.02
"""Metres by which a tool stays within the sides and the top of the workspace: a robot is stopped that could
not stop before them."""


class Collisions:
    """A robot among things, in its workspace.

    Args:
        bodies: The robot's.
        hand: Positions ``(n_hand,)`` of the hand's joints.
        things: What stands around.
        held: What is in the hand, if anything.
        leave: What may touch.
        own: Metres that the robot's own bodies keep from each other.
        workspace: Corners ``(2, 3)`` of the box in which the tool's origin stays, see `bounds`.
    """

    def __init__(
        self,
        bodies: RobotBodies,
        hand: Array,
        things: Sequence[Thing],
        held: Held | None = None,
        leave: Leave | None = None,
        own: float = OWN,
        workspace: Array | None = None,
    ) -> None:
        self._workspace = workspace
        self._bodies, self._q = bodies, bodies.configuration(bodies.robot.rest, hand)
        self._arm = bodies.order[: len(bodies.robot.arm_joints)]
        self._pairs = Pairs(
            bodies.model,
            bodies.shapes,
            bodies.links,
            leave,
            bodies.of_frames,
            bodies.boxes(hand),
            bodies.carriers,
            lambda: bodies.data,
        )
        frame, placement = bodies.carriers[bodies.tool_joint]
        self._tool_frame, self._tool = frame, placement @ bodies.tool_placement.homogeneous
        inside = self._pairs.add_held(held, bodies.tool_joint, bodies.tool_placement)
        self._pairs.compare(bodies.own_pairs, own)
        self._pairs.compare((i, k) for i in bodies.before_tool for k in inside)
        self._pairs.stand(things, bodies.movers, bodies.hands, inside)

    def free(self, arm: Array) -> bool:
        """Nothing touches with the arm's joints at ``arm (n_arm,)``, and the tool is in the workspace."""
        framed = partial(self._bodies.framed, arm)
        return self._pairs.free(self._at(arm), framed) and self._stays(arm)

    def all_free(self, arms: Array) -> bool:
        """Nothing touches at any of ``arms (n, n_arm)``; the middle ones are asked first."""
        if not len(arms):
            return True
        frames = self._bodies.frames(arms)
        if self._workspace is not None:
            tools = (frames[:, self._tool_frame] @ self._tool[:, 3])[:, :3]
            if not _within(self._workspace, tools):
                return False
        near = self._pairs.near(frames)
        return all(self._pairs.clear(self._at(q)) for q in halves(arms[near]))

    def touches(self, arm: Array) -> list[Touch]:
        """What touches with the arm's joints at ``arm (n_arm,)``."""
        found = self._pairs.touches(self._at(arm), self._bodies.framed(arm))
        return found if self._stays(arm) else [*found, ("the tool", "the border of its workspace")]

    def keys(self, arm: Array) -> list[Touch]:
        """The same by keys of things, see `Thing.key`."""
        return self._pairs.keys(self._at(arm), self._bodies.framed(arm))

    def _stays(self, arm: Array) -> bool:
        """The tool is in the workspace, if there is one, with the arm's joints at ``arm (n_arm,)``."""
        return self._workspace is None or _within(self._workspace, self._tool_pose(arm).translation)

    def tool_rotation(self, arm: Array) -> Array:
        """The tool's rotation ``(3, 3)`` with the arm's joints at ``arm (n_arm,)``."""
        found: Array = self._tool_pose(arm).rotation
        return found

    def _tool_pose(self, arm: Array) -> pin.SE3:
        """Where the tool is; for one posture Pinocchio is quicker than `ArmFrames`."""
        bodies, data = self._bodies, self._bodies.data
        pin.forwardKinematics(bodies.model, data, self._at(arm))
        return data.oMi[bodies.tool_joint] * bodies.tool_placement

    def _at(self, arm: Array) -> Array:
        """Pinocchio's ``q``."""
        self._q[self._arm] = arm
        return self._q


def _within(corners: Array, points: Array) -> bool:
    """Points ``(..., 3)`` are all in a box of `bounds`: `beyond` is 0, asked for each posture of a search."""
    low, high = corners
    return bool(((low <= points) & (points <= high)).all())


def bounds(robot: RobotDescription, start: Array) -> Array | None:
    """Corners ``(2, 3)`` of the box in which a tool's origin stays on its way; None without safety limits.

    Args:
        robot: The robot.
        start: Tool pose ``(7,)`` where the way begins, which may be farther out.
    """
    if robot.safety is None:
        return None
    low, high = robot.safety.workspace
    less = np.minimum(INSIDE, (high - low) / 4)  # a box of few centimetres keeps half of its size
    inner = np.array([low + less * [1.0, 1.0, 0.0], high - less])
    return np.array([np.minimum(inner[0], start[:3]), np.maximum(inner[1], start[:3])])


def beyond(box: Array | None, tools: Array) -> Array:
    """Metres ``(k,)`` by which tool poses ``(k, 7)`` are outside a box of `bounds`; 0 where there is none."""
    if box is None:
        return np.zeros(len(tools))
    points = tools[:, :3]
    found: Array = np.maximum(box[0] - points, points - box[1]).max(axis=1).clip(min=0.0)
    return found
