"""Grasps that may be tried on an object: from where it may be held, by directions from which a hand may come.

Where it may be held says the object itself (`bt_tasksim.scene.grips`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bt_tasksim.concept_nodes.grasp_pose import beside_standing
from bt_tasksim.concept_nodes.view import PALM, WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.arm import FULL, LEANS
from bt_tasksim.planning.closing import closing_of
from bt_tasksim.planning.hand_collision import beyond
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.hand import depth_at, shorter_at, standing_side, swung_at
from bt_tasksim.scene.chords import chords
from bt_tasksim.scene.grips import Grips, fits_between

AROUND = 24
"""Directions about a closing axis from which a hand may come."""
STEEPEST = 0.35
"""Largest upward part of a direction in which a hand comes, of length one."""
SPARE_DEPTH = 0.004
"""Metres that fingers reach less deep where they come level: the estimate may be wrong."""
LESS_DEEP = (0.0, 0.007, 0.014)
"""Metres less deep that a hand may reach, where its fingertips would meet what the object stands on."""
TIPS = (0.004, 0.007, 0.009, 0.011, 0.0125, 0.014, 0.016, 0.018, 0.0215)
"""The same for a hand one finger of which stands still: its fingers end beyond the tool's origin, and what is
low it holds by their ends, as far down as its support lets them."""
DEEPER = (0.021, 0.014, 0.007)
"""Metres deeper than `SPARE_DEPTH` lets it that a hand of many fingers may reach, around a round side above
all: its fingers leave more room than the depth that its file gives for whatever it holds."""
HOLD = 0.006
"""Metres that fingertips reach below an object's top at least."""
HOLD_BY_ENDS = 0.004
"""The same where one finger stands still: what such a hand takes is small, and low things it holds by its
ends."""
PAD = 0.008
"""Metres by which a hand may take hold of a mesh beside the middle of a grip: farther off may be a hollow."""
THIN = 0.012
"""Metres of width below which a grip is disfavoured: a hand that comes some millimetres beside a wall misses
it."""
MISSED = 2.0
"""How much more so for a jaw that swings: of four bowls of 5 cm whose walls of 3 mm it was to take, it threw
all aside, and held all of them by both sides."""
TIGHT = 0.007
"""Metres of room on either side below which a grip is disfavoured: estimates are wrong by millimetres."""
AS_WIDE = 0.9
"""Share of a grip's width that an object has to have where the hand is held back from it: fingers that close
on a rounded side before its middle squeeze it out. A circle's sides there are 26 degrees from parallel."""
HOLLOW = "mesh"
"""The kind of object of which the middle of its box may be hollow, or beside it."""
EASE = 0.3
"""Radians that a radian of turn from where the arm is at ease costs an arm of few joints: the last of them
alone turns its hand about an approach, and that one goes all around."""
SWUNG = 2.0
"""What a grip costs for each radian by which a jaw that swings leans away from it: where it leans it meets an
edge, and pushes what it holds out of the hand."""
WALL = 0.005
"""Metres of width below which a grip is a poor one for a jaw that swings."""
POOR, LEANT = 0.6, 0.2
"""Share of the firmest grip's firmness below which another one is a poor one, and radians by which a jaw that
swings leans from which it is."""
ALIKE = 0.35
"""Radians of turn within which what was wrong with one grasp is mostly wrong with another one, too."""
LEANING = (0.0, 0.35, -0.35, 0.7, -0.7)
"""Radians by which a hand may come to the handle of a part of furniture turned about the closing axis from
the given approach: to go along with a door is harder than to hold it."""
WRONG = 0.8
"""What a grasp costs more for each one like it that was no good, in radians of turn from the usual one."""


class Candidates:
    """Grasps of an object, the likeliest first; those like others that were no good come later.

    Iterating takes them one by one.

    Args:
        tools: Tool poses ``(k, 7)``.
        costs: What each costs ``(k,)``; the least is the likeliest.
        widths: Of what is held ``(k,)``, metres.
        poor: Booleans ``(k,)``: it holds much less well than others would; by default none does.
    """

    def __init__(self, tools: Array, costs: Array, widths: Array, poor: Array | None = None) -> None:
        order = np.argsort(costs, kind="stable")
        self.tools, self.costs, self.widths = tools[order], costs[order], widths[order]
        self.poor: Array = np.zeros(len(costs), bool) if poor is None else poor[order]
        self._left = np.ones(len(costs), bool)
        self._wrong = np.zeros(len(costs))

    def __iter__(self) -> Iterator[Array]:
        return self

    def __next__(self) -> Array:
        return self.taken()[1]

    def taken(self) -> tuple[float, Array, float]:
        """What the next one costs, itself, and the width of what it holds in metres.

        Raises:
            StopIteration: There is none.
        """
        if not self._left.any():
            raise StopIteration
        costs = np.where(self._left, self.costs + self._wrong, np.inf)
        k = int(np.argmin(costs))
        self._left[k] = False
        return float(costs[k]), self.tools[k], float(self.widths[k])

    def no_good(self, tool: Array) -> None:
        """A grasp ``(7,)`` was none: the arm cannot come there, or not go on from there."""
        turn = poses.angle_between(self.tools[:, 3:], tool[None, 3:])
        self._wrong += WRONG * np.exp(-((turn / ALIKE) ** 2))

    def costing(self, costs: Array) -> Candidates:
        """The same at other costs ``(k,)``."""
        return Candidates(self.tools, costs, self.widths, self.poor)

    def keeping(self, which: Array) -> Candidates:
        """Those of a mask ``(k,)``."""
        return Candidates(self.tools[which], self.costs[which], self.widths[which], self.poor[which])


def candidates(view: WorldView, target: str, approach: Array, neutral: Array) -> Candidates:
    """Grasps that may be tried on an object.

    Args:
        view: The world.
        target: The object.
        approach: Unit vector ``(3,)`` in which the hand usually comes, robot base frame.
        neutral: The tool orientation ``(4,)`` in which the arm is at ease there.
    """
    model, pose = view.model(target), view.objects[target]
    if model.solid is None:
        return Candidates(np.zeros((0, 7)), np.zeros(0), np.zeros(0))
    grips = model.solid.grips
    grips = grips.taken(fits_between(grips.widths, view.robot.opening))
    leaning = LEANING if model.joint is not None else LEANING[:1]
    which, along = _directions(pose, grips.closing, grips.approach, leaning)
    points = poses.transform(pose[None], grips.points)[which]
    closing = poses.rotate(pose[None, 3:], grips.closing)[which]
    widths, firmness = grips.widths[which], grips.firmness[which]
    corners = np.concatenate([poses.transform(pose, piece) for piece in pieces_of(model)])
    reach = np.sum(points * along, axis=1) - np.min(corners @ along.T, axis=0, initial=np.inf)
    deep = depth_at(view.robot, widths)
    buried = np.maximum(reach - (deep - PALM - SPARE_DEPTH * np.hypot(along[:, 0], along[:, 1])), 0.0)
    # What rises above a point beside it need not be in the hand's way.
    first = 0.0 * buried if model.kind == HOLLOW else buried
    side = standing_side(view.robot)
    longer: Array = np.zeros((len(widths), 1, 1))
    tips: tuple[float, ...] = LESS_DEEP[1:]
    if side is not None:
        longer = np.maximum(beyond(view.robot) - shorter_at(view.robot, widths), 0.0)[:, None, None]
        tips = TIPS
    less = (0.0, *tips) if model.kind == HOLLOW else tips
    # The palm of a hand of many fingers is no plane: the hand itself says later what it would touch.
    many = view.robot.many_fingers
    deep = many and model.kind != HOLLOW
    deeper = [np.maximum(buried - more, 0.0) for more in DEEPER if deep]
    shifts = np.stack([*deeper, buried, *(first + more for more in less)], axis=-1)[:, None]
    axes = np.array([1.0, -1.0])[None, :, None, None] * closing[:, None, None]
    position = points[:, None, None] - shifts[..., None] * along[:, None, None]
    if many:
        middle = closing_of(view.robot).middle(widths)[:, None, None]
        position = position - middle[..., 1:2] * axes - middle[..., 2:3] * along[:, None, None]
    if side is not None:
        position = position - beside_standing(side, widths / 2)[:, None, None, None] * axes
    rotation = poses.frame_from_axes(np.broadcast_to(along[:, None, None], axes.shape), axes)
    lean = closing_of(view.robot).lean if many else 0.0
    if lean:  # upright and leaned, each both ways round
        leaned = poses.quat_multiply(rotation, poses.from_rotation_vector(np.array([lean, 0.0, 0.0])))
        rotation = np.concatenate([rotation, leaned], axis=1)
        position = np.concatenate([position + 0.0 * axes] * 2, axis=1)
    given = poses.rotate(pose[3:], grips.approach)[which]
    usual = np.where(np.isfinite(given).all(axis=-1, keepdims=True), given, approach)
    turned = np.arccos(np.clip(np.sum(along * usual, axis=-1), -1.0, 1.0))
    room = (view.robot.opening - widths) / 2
    thin = np.maximum(0.0, 1.0 - widths / THIN)
    own = turned + 1.5 * (1.0 - firmness) + (thin if side is None else MISSED * thin)
    own = own + np.maximum(0.0, 1.0 - room / TIGHT) + SWUNG * swung_at(view.robot, widths)
    ease = 1.0 if len(view.robot.arm_joints) >= FULL else EASE
    costs = ease * poses.angle_between(rotation, neutral) + 20.0 * shifts + own[:, None, None]
    less_held = np.maximum(shifts - longer, 0.0)
    if model.kind == HOLLOW:
        good = less_held <= (PAD if side is None else PAD / 2)
    else:
        good = _as_wide(view, target, grips.taken(which), along, less_held)
    hold = HOLD if side is None else HOLD_BY_ENDS
    possible = (shifts == 0.0) | ((reach[:, None, None] + longer - shifts >= hold) & good)
    possible[..., 1:] &= (shifts[..., 1:] != shifts[..., :1]) if deep else True
    possible = possible & _in_its_plane(view.robot, along, neutral)[:, None, None]
    wanted = np.broadcast_to(possible, costs.shape).reshape(-1)
    placed = (*costs.shape, 3), (*costs.shape, 4)
    parts = [np.broadcast_to(a, shape) for a, shape in zip((position, rotation), placed, strict=True)]
    tools = np.concatenate(parts, axis=-1)
    firm = firmness >= POOR * np.max(grips.firmness, initial=0.0)
    poor = ~firm | (swung_at(view.robot, widths) > LEANT) | ((side is not None) & (widths < WALL))
    shallow = poor[:, None, None] | (reach[:, None, None] + longer - shifts < HOLD)
    held, bad = (np.broadcast_to(v, costs.shape).reshape(-1) for v in (widths[:, None, None], shallow))
    return Candidates(tools.reshape(-1, 7)[wanted], costs.reshape(-1)[wanted], held[wanted], bad[wanted])


def _as_wide(view: WorldView, target: str, grips: Grips, along: Array, shifts: Array) -> Array:
    """Whether an object is about as wide where a hand is held back as at the grips themselves.

    Args:
        view: The world.
        target: The object.
        grips: Grips ``(m,)``, one for each of the directions.
        along: Directions ``(m, 3)`` in which hands come, robot base frame.
        shifts: Metres ``(m, 1, s)`` by which they are held back.
    """
    back = poses.rotate(poses.quat_conjugate(view.objects[target][3:]), along)
    held = np.concatenate([np.zeros_like(shifts[:, 0, :1]), shifts[:, 0]], axis=-1)
    points = grips.points[:, None] - held[..., None] * back[:, None]
    lines = np.broadcast_to(grips.closing[:, None], points.shape)
    thick = chords(pieces_of(view.model(target)), points.reshape(-1, 3), lines.reshape(-1, 3))
    thick = thick.reshape(held.shape)
    found: Array = (thick[:, 1:] >= AS_WIDE * thick[:, :1])[:, None]
    return found


def narrowest_grip(view: WorldView, target: str) -> float:
    """Least width in metres at which an object can be held; infinite where nothing is known of it."""
    solid = view.model(target).solid
    return float(np.min(solid.grips.widths, initial=np.inf)) if solid is not None else np.inf


def _directions(
    pose: Array, closing: Array, approach: Array, leaning: Sequence[float] = LEANING[:1]
) -> tuple[Array, Array]:
    """By which grips ``(m,)`` hands may come in which directions ``(m, 3)``, robot base frame.

    Args:
        pose: The object's ``(7,)``.
        closing: Closing axes ``(k, 3)`` in its frame.
        approach: Given directions ``(k, 3)``, likewise; NaN where any across the closing axis will do.
        leaning: Radians by which a hand may come turned from a given direction about the closing axis.
    """
    which, along = [], []
    for k, (axis, come) in enumerate(zip(poses.rotate(pose[None, 3:], closing), approach, strict=True)):
        if np.isfinite(come).all():
            turns = poses.from_rotation_vector(np.array(leaning)[:, None] * axis)
            ways = poses.rotate(turns, poses.rotate(pose[3:], come)[None])
        else:
            ways = across(axis)
        ways = ways[ways[:, 2] <= STEEPEST]
        which += [k] * len(ways)
        along.append(ways)
    return np.array(which, int), np.concatenate([np.zeros((0, 3)), *along])


def _in_its_plane(robot: RobotDescription, along: Array, neutral: Array) -> Array:
    """Whether an arm can come in directions ``(m, 3)``: one of five joints cannot lean out of its plane.

    That plane is upright, and the closing axis of the neutral orientation ``(4,)`` is its normal; so the
    rotation about that axis is the one that the robot's `task_mask` leaves free.
    """
    if robot.task_mask[4] > 0.0:
        return np.ones(len(along), bool)
    normal = poses.rotate(neutral, np.array([0.0, 1.0, 0.0]))
    inside: Array = abs(along @ normal) <= math.sin(LEANS)
    return inside


def across(axis: Array) -> Array:
    """Unit vectors ``(AROUND, 3)`` across an axis, all around; straight down and level ones among them."""
    down = np.array([0.0, 0.0, -1.0])
    first = down - axis * float(axis @ down)
    if float(np.linalg.norm(first)) < 1e-6:
        first = np.array([1.0, 0.0, 0.0])
    first = first / np.linalg.norm(first)
    second = np.cross(axis, first)
    angles = 2 * np.pi * np.arange(AROUND) / AROUND
    found: Array = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second
    return found
