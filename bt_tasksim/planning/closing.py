"""What the fingers of a hand meet when they close on an object, and whether they hold it: geometry alone.

Grips say where two fingers may hold an object. A hand with more of them has some beside that place, which
may meet another part of the object first, or nothing. The fingers of each side count as one *virtual finger*
(M. A. Arbib, T. Iberall and D. Lyons, "Coordinated control programs for movements of the hand", 1985), and
two of them hold where the line between them leaves both along the object's normals, up to friction
(V.-D. Nguyen, "Constructing force-closure grasps", Int. J. Robotics Research 7(3), 1988).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.convex_hulls import convex
from bt_tasksim.core.narrow_phase import coal
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.hand_collision import hand_shapes
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.hand import tips_in_tool
from bt_tasksim.robot.kinematics.models import se3

_Placed = Sequence[tuple[Any, Any]]
"""Shapes and where they are."""

_STEPS = 21
"""Closures at which it is asked whether a finger touches: between two of them one moves by 3 mm."""
_TOGETHER = 0.25
"""Closures within which fingers of one side count as pressing together: beyond, the others have pushed the
object along before."""
_LEAST = 0.02
"""Share of its force with which a finger counts that meets an object at the very end."""


class Meeting(NamedTuple):
    """What each fingertip of a hand meets first.

    Attributes:
        closure: Closures ``(n_tips,)`` at which they touch the object; infinite where one meets nothing, or
            something else before.
        points: Points of contact ``(n_tips, 3)`` in the tool frame, metres; zero where there is none.
        normals: Unit vectors ``(n_tips, 3)`` there, into the object; zero where there is none.
    """

    closure: Array
    points: Array
    normals: Array


class Squeeze(NamedTuple):
    """How the two sides of a hand press on an object.

    Attributes:
        angle: The larger angle between the line from one side to the other and the normal of either, radians.
        ahead: Metres along the tool's y axis by which the tool has to go so that both sides meet the object
            at once.
        out: How hard all fingers push the object away from the palm, as a share of how hard they squeeze it;
            below 0 they draw it in.
    """

    angle: float
    ahead: float
    out: float


class _Side(NamedTuple):
    """The fingers of one side as one: closure, point ``(3,)`` and normal ``(3,)`` at which it meets."""

    closure: float
    point: Array
    normal: Array


class HandClosing:
    """The fingers of one hand while it closes.

    Args:
        robot: The robot.

    Attributes:
        moves: Booleans ``(n_tips,)``: the fingertip moves when the hand closes.
    """

    def __init__(self, robot: RobotDescription) -> None:
        bodies = bodies_of(robot)
        self._sides = robot.opposition
        self._closures = np.linspace(0.0, 1.0, _STEPS)
        at = [hand_shapes(bodies, robot.hand_position(np.array([c]))) for c in self._closures]
        self._tips = [
            [[(shape, _placed(at)) for link, at, shape in shapes if link in tip.links] for shapes in at]
            for tip in robot.tips
        ]
        self._swept = [_bounds([placed for placed_at in tip for placed in placed_at]) for tip in self._tips]
        tips = np.array([tips_in_tool(robot, robot.hand_position(np.array([c]))) for c in self._closures])
        one, other = (tips[:, list(side)].mean(axis=1) for side in self._sides[:2])
        self._between = np.stack([one[:, 1], other[:, 1]], axis=-1)
        self._middles = (one + other) / 2 * [0.0, 1.0, 1.0]
        way = np.linalg.norm(tips[-1] - tips[0], axis=1)
        self.moves: Array = way > 1e-6
        self._forces = _spring_forces(robot) / np.maximum(way, 1e-6)

    @cached_property
    def lean(self) -> float:
        """Radians about the tool's x axis by which the hand leans so that both sides reach equally deep.

        Half closed, as for most things: where they stand on, the side that reaches deeper is in the way.
        """
        half = _STEPS // 2
        deep = np.array([max(_depth(*placed) for placed in tip[half]) for tip in self._tips])
        one, other = (list(tips) for tips in self._sides[:2])
        gap = float(self._between[half, 1] - self._between[half, 0])
        return float(np.arctan2(deep[one].max() - deep[other].max(), gap)) if gap > 0.0 else 0.0

    def middle(self, widths: Array) -> Array:
        """Points ``(m, 3)`` midway between fingertips ``widths (m,)`` apart; metres, tool frame.

        Fingers that swing draw back when they close: on what is thin they meet nearer to the palm.
        """
        gap = self._between[:, 1] - self._between[:, 0]
        order = np.argsort(gap)
        found = [np.interp(widths, gap[order], values[order]) for values in self._middles.T]
        return np.stack(found, axis=-1)

    def about(self, width: float) -> Array:
        """The largest closure ``()`` that is looked at with the sides at least so many metres apart, or 0."""
        wide = self._between[:, 1] - self._between[:, 0] >= width
        return np.asarray(self._closures[: int(np.argmin(wide)) or len(wide)].max() if wide[0] else 0.0)

    def met(self, grip: Array, pieces: Sequence[Array], others: Sequence[Array] = ()) -> Meeting:
        """What the fingertips meet.

        Args:
            grip: The object's pose ``(7,)`` in the tool frame.
            pieces: Corners ``(n, 3)`` of its convex pieces, in its own frame.
            others: The same of what stands around it, in its frame, too: a finger that meets one of them
                first closes on that.
        """
        solids, at = [convex(piece) for piece in pieces], _placed(se3(grip))
        boxes = [_box(poses.transform(grip, piece)) for piece in others]
        found = []
        for tip, swept in zip(self._tips, self._swept, strict=True):
            beside = [convex(p) for p, box in zip(others, boxes, strict=True) if _overlap(box, swept)]
            found.append(self._first(tip, solids, beside, at))
        closure, points, normals = zip(*found, strict=True)
        return Meeting(np.array(closure), np.array(points), np.array(normals))

    def squeeze(self, met: Meeting) -> Squeeze | None:
        """How both sides press; None where one of them meets nothing."""
        one, other = (self._side(met, list(tips)) for tips in self._sides[:2])
        if one is None or other is None:
            return None
        between = other.point - one.point
        between = between / max(float(np.linalg.norm(between)), 1e-9)
        cosine = min(float(one.normal @ between), float(-other.normal @ between))
        width = np.array([other.point[1] - one.point[1]])
        ahead = float((one.point[1] + other.point[1]) / 2 - self.middle(width)[0, 1])
        return Squeeze(float(np.arccos(np.clip(cosine, -1.0, 1.0))), ahead, self._out(met))

    def _out(self, met: Meeting) -> float:
        """See `Squeeze.out`: those count, too, that come late and press on the object's top."""
        weights = (1.0 + _LEAST - np.minimum(met.closure, 1.0 + _LEAST)) * self._forces
        return float(weights @ met.normals[:, 2]) / max(float(weights @ abs(met.normals[:, 1])), 1e-9)

    def _side(self, met: Meeting, tips: list[int]) -> _Side | None:
        closure = met.closure[tips]
        first = float(closure.min())
        if not np.isfinite(first):
            return None
        presses = np.where(closure <= first + _TOGETHER, 1.0 + _LEAST - np.minimum(closure, 1.0), 0.0)
        weights = presses * self._forces[tips]
        normal = weights @ met.normals[tips]
        point = weights @ met.points[tips] / weights.sum()
        return _Side(first, point, normal / max(float(np.linalg.norm(normal)), 1e-9))

    def _first(
        self, tip: Sequence[_Placed], solids: Sequence[Any], beside: Sequence[Any], at: Any
    ) -> tuple[float, Array, Array]:
        for closure, shapes in zip(self._closures, tip, strict=True):
            contact = _contact(shapes, solids, at)
            if contact is not None:
                return float(closure), np.array(contact.pos), np.array(contact.normal)
            if beside and _contact(shapes, beside, at) is not None:
                break
        return np.inf, np.zeros(3), np.zeros(3)


def closing_of(robot: RobotDescription) -> HandClosing:
    """The closing of a robot's hand, made once."""
    found: HandClosing = robot.derived("closing", HandClosing)
    return found


def _contact(shapes: _Placed, solids: Sequence[Any], at: Any) -> Any:
    """The first contact between placed shapes and solids; None where they do not touch."""
    request = coal.CollisionRequest(coal.CollisionRequestFlag.CONTACT, 1)
    for shape, placed in shapes:
        for solid in solids:
            result = coal.CollisionResult()
            if coal.collide(shape, placed, solid, at, request, result):
                return result.getContact(0)
    return None


def _bounds(placed: _Placed) -> tuple[Array, Array]:
    """Least and largest coordinates ``(3,)`` of placed shapes, by the boxes about them."""
    corners = []
    for shape, at in placed:
        shape.computeLocalAABB()
        box = shape.aabb_local
        own = np.array(list(itertools.product(*zip(box.min_, box.max_, strict=True))))
        corners.append(own @ np.array(at.getRotation()).T + np.array(at.getTranslation()))
    return _box(np.concatenate(corners))


def _box(points: Array) -> tuple[Array, Array]:
    return points.min(axis=0), points.max(axis=0)


def _overlap(one: tuple[Array, Array], other: tuple[Array, Array]) -> bool:
    return bool(np.all(one[0] <= other[1]) and np.all(other[0] <= one[1]))


def _depth(shape: Any, at: Any) -> float:
    """How far a placed shape reaches along the tool's z axis, metres: up to a floor that is 1 m away."""
    floor, below = coal.Box(4.0, 4.0, 0.1), coal.Transform3s(np.eye(3), np.array([0.0, 0.0, 1.05]))
    return 1.0 - float(coal.distance(shape, at, floor, below, coal.DistanceRequest(), coal.DistanceResult()))


def _placed(placement: Any) -> Any:
    return coal.Transform3s(placement.rotation, placement.translation)


def _spring_forces(robot: RobotDescription) -> Array:
    """What the drives that move each tip ``(n_tips,)`` press with over the whole of a closing, N m or N."""
    span = robot.hand_closed - robot.hand_open
    opened = tips_in_tool(robot, robot.hand_open)
    work = robot.hand_drive.stiffness * robot.hand_drive_scale * span**2
    found = np.zeros(len(robot.tips))
    for joint, part in enumerate(span * np.eye(len(span))):
        moved = np.linalg.norm(tips_in_tool(robot, robot.hand_open + part) - opened, axis=1) > 1e-6
        found += moved * work[joint]
    return found
