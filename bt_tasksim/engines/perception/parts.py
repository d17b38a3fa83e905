"""How far parts of fixtures are taken to be open: as they are seen, or as the hand has left them.

A part is on its joint, whose axis is calibrated; so what is seen of it is brought onto the joint. Where the
scene does not say that the part is sensed, the robot knows how it stands at the beginning, as it was seen
then or else as the scene says, and from then on what its hand does with it: the part goes along with fingers
that hold it by one of its grasps, and with a fist that touches it. Fingers slip; so a part that is taken to
be near its stop is at it once the hand feels that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.joints import NEAR_STOP, Joints
from bt_tasksim.core.poses import Array, constant, host
from bt_tasksim.core.world import ObjectModel, WorldState
from bt_tasksim.scene.configuration import ActorConfiguration

HELD = 0.025
"""Metres from the middle between fingertips to a grasp of a part within which they hold it."""
TOUCHED = 0.012
"""Metres from a fingertip to a part within which a fist that feels something touches it: pads have a size,
and estimates err."""
ASIDE, TURNED = 0.002, math.radians(2.0)
"""Metres and radians by which good estimates are wrong."""
SLIPPED = 0.5
"""Share of the distance of its tips from their middle to which a hand closes when a part slips out of it."""
ABOUT = 1.02
"""The same to which it may open while fingers that held a part, and are not felt now, are about it still:
what moves in a soft hand is touched by no fingertip for an instant."""
FIST = 0.9
"""Closure from which a hand is a fist."""
STILL, RISES = 0.0005, 6.0
"""Metres that fingertips go along a joint at most while the force against them grows by so many newtons,
where the part is stopped: what rubs does not hold them with ever more, and no spring is so stiff."""


@dataclass(eq=False)
class TrackedPart:
    """One part in one world.

    Attributes:
        column: Where it stands among the objects.
        model: What is known of it.
        joint: Its joint ``(1,)``.
        told: How far it is open at the beginning ``(1,)``, as the scene says.
        value: How far it is taken to be open ``(1,)``, once somebody has looked.
        spread: Metres of the fingertips from their middle, at most, since some touch; 0 once they open.
        about: Fingers that held it are about it.
        gone: Metres that the tips have gone along the joint with the part since `pushed` was felt.
        pushed: Force of the part on the hand then, towards larger values, N; None where it is not held.
    """

    column: int
    model: ObjectModel
    joint: Joints
    told: Array
    value: Array | None = None
    spread: float = 0.0
    about: bool = False
    gone: float = 0.0
    pushed: float | None = None

    @property
    def sensed(self) -> bool:
        """The robot sees how far it is open."""
        assert self.model.joint is not None
        return self.model.joint.sensed


@dataclass(frozen=True)
class HandContact:
    """A hand at one instant, in one world.

    Attributes:
        tips: ``(n_tips, 3)``, robot base frame.
        touching: Booleans ``(n_tips,)``.
        closure: From 0, open, to 1.
        tool: Pose ``(7,)`` of the tool.
        wrench: External wrench ``(6,)`` at the tool, in its frame.
    """

    tips: Array
    touching: Array
    closure: float
    tool: Array
    wrench: Array

    @property
    def spread(self) -> float:
        """The farthest that a tip is from their middle, metres."""
        return float(np.linalg.norm(self.tips - self.tips.mean(axis=0), axis=-1).max())


class Parts:
    """The parts of the worlds of a batch.

    Args:
        n: Number of worlds.
    """

    def __init__(self, n: int) -> None:
        self._parts: list[list[TrackedPart]] = [[] for _ in range(n)]
        self._hands: list[HandContact | None] = [None] * n
        self._any = False

    def reset(self, rows: Sequence[int] | np.ndarray, configurations: Sequence[ActorConfiguration]) -> None:
        """Worlds begin new episodes."""
        for row, configuration in zip(rows, configurations, strict=True):
            found = []
            for column, actor in enumerate(configuration.objects):
                if actor.joint is not None:
                    model = actor.model()
                    assert model.joint is not None
                    joint = Joints.of([model.joint])
                    told = joint.value(np.array(actor.pose, float)[None])
                    found.append(TrackedPart(column, model, joint, told))
            self._parts[row], self._hands[row] = found, None
        self._any = any(self._parts)

    def placed(
        self, state: WorldState, touching: Array, closure: Array, estimate: Array, rows: np.ndarray
    ) -> Array:
        """Estimates ``(k, n_objects, 7)`` with the parts where they are taken to be.

        Args:
            state: The states ``(k, ...)``.
            touching: Boolean ``(k, n_tips)``.
            closure: ``(k,)``.
            estimate: What was seen.
            rows: Which worlds these are ``(k,)``.
        """
        if not self._any:
            return estimate
        known = (estimate, state.tips, touching, closure, state.tool_pose, state.wrench)
        seen, tips, felt, shut, tools, wrenches = (np.array(host(v)) for v in known)
        for i, row in enumerate(rows.tolist()):
            if self._parts[row]:
                hand = HandContact(tips[i], felt[i], float(shut[i]), tools[i], wrenches[i])
                for part in self._parts[row]:
                    self._follow(part, seen[i, part.column], self._hands[row], hand)
                    if part.value is not None:
                        seen[i, part.column] = part.joint.pose(part.value)[0]
                self._hands[row] = hand
        return constant(seen, estimate)

    @staticmethod
    def _follow(part: TrackedPart, seen: Array, before: HandContact | None, hand: HandContact) -> None:
        if part.value is None or part.sensed:
            if np.isfinite(seen).all():
                part.value = _value(part.joint, seen)
            elif not part.sensed:
                part.value = part.told
            return
        if before is None:
            return
        both, pushed = before.touching & hand.touching, part.pushed
        part.pushed = None
        part.about &= SLIPPED * part.spread <= hand.spread <= ABOUT * part.spread
        if int(both.sum()) > 1:
            part.spread = max(part.spread, hand.spread)
        elif part.about:
            both = np.ones_like(both)
        elif hand.spread > part.spread:  # it has opened
            part.spread = 0.0
        if not both.any() or hand.spread < SLIPPED * part.spread:
            return
        pose = part.joint.pose(part.value)[0]
        was, now = before.tips[both], hand.tips[both]
        part.about = _holds(part.model, pose, before, both)
        if not part.about and not _pushes(part.model, pose, before, both):
            return
        moved = _moved(part.joint, part.value, was, now)
        low, high = part.joint.limits[:, 0], part.joint.limits[:, 1]
        part.value, part.pushed = np.clip(part.value + moved, low, high), pushed
        _feel_stop(part, moved, hand)


def _moved(joint: Joints, value: Array, was: Array, now: Array) -> Array:
    """By how much a value ``(1,)`` grows when fingertips that hold the part go from ``(k, 3)`` to ``(k, 3)``.

    Of what turns it is the turn about the axis that fits all of them best: fingers on a knob go round it.
    """
    if not bool(joint.turns[0]):
        return joint.shift(value, was.mean(axis=0)[None], now.mean(axis=0)[None])
    pose = joint.pose(value)[0]
    axis, centre = poses.rotate(pose[3:], joint.axis[0]), poses.transform(pose, joint.origin[0])
    a, b = ((tips - centre) - ((tips - centre) @ axis)[:, None] * axis for tips in (was, now))
    turn: Array = np.arctan2((np.cross(a, b) @ axis).sum(), (a * b).sum())
    return np.array([turn])


def _feel_stop(part: TrackedPart, moved: Array, hand: HandContact) -> None:
    """Take a part to be at the stop that it is near, where the hand that moved it so feels it."""
    assert part.value is not None
    at, joint = hand.tool[None, :3], part.joint
    force, torque = (poses.rotate(hand.tool[None, 3:], v[None]) for v in (hand.wrench[:3], hand.wrench[3:]))
    now = float(joint.force(part.value, at, force, torque)[0])
    part.gone += float(moved[0] * joint.reach(part.value, at)[0])
    if part.pushed is None or abs(part.gone) > STILL:
        part.gone, part.pushed = 0.0, now
        return
    way = 1.0 if now > part.pushed else -1.0
    stop = joint.limits[:, 0 if way > 0.0 else 1]
    grown = min(way * now, way * (now - part.pushed))
    if grown > RISES and abs(stop - part.value)[0] < NEAR_STOP[bool(joint.turns[0])]:
        part.value, part.gone, part.pushed = stop.copy(), 0.0, now


def _value(joint: Joints, seen: Array) -> Array:
    """The value ``(1,)`` of a part that is seen at a pose ``(7,)``.

    Of what turns, where it is says more than how it is turned, the more so the farther its middle is from the
    axis: the two are weighed by what they are usually wrong by.
    """
    turned: Array = joint.value(seen[None])
    if not bool(joint.turns[0]):
        return turned
    lever = float(np.linalg.norm(np.cross(joint.axis[0], joint.origin[0])))
    moved = joint.shift(turned, joint.pose(turned)[:, :3], seen[None, :3])
    sure, less = (lever / ASIDE) ** 2, (1.0 / TURNED) ** 2
    found: Array = turned + moved * sure / (sure + less)
    return np.clip(found, joint.limits[:, 0], joint.limits[:, 1])


def _holds(model: ObjectModel, pose: Array, hand: HandContact, touching: Array) -> bool:
    """Whether a hand holds a part by one of its grasps."""
    solid = model.solid
    if solid is None or int(touching.sum()) < 2 or not len(solid.grips.points):
        return False
    away = poses.transform(pose[None], solid.grips.points) - hand.tips.mean(axis=0)
    return float(np.linalg.norm(away, axis=-1).min()) < HELD


def _pushes(model: ObjectModel, pose: Array, hand: HandContact, touching: Array) -> bool:
    """Whether a fist touches a part."""
    solid = model.solid
    if solid is None or hand.closure < FIST:
        return False
    local = poses.transform(poses.inverse(pose)[None], hand.tips[touching])
    return any(_distance(piece, local) < TOUCHED for piece in solid.pieces)


def _distance(corners: Array, points: Array) -> float:
    """Metres from the nearest of points ``(n, 3)`` to the upright box about corners ``(m, 3)``."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    out = np.maximum(np.maximum(low - points, points - high), 0.0)
    return float(np.linalg.norm(out, axis=-1).min())
