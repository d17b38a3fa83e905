"""How a hand, or what it holds, stands behind a thing that it is to move along what that stands on.

Of hands that lean and are turned about the vertical so or so, those come first that touch the thing low, on
both sides of its middle, and over a width: what is pushed by a wide front turns little. Contacts are found
from level cuts through the pusher and the thing (`bt_tasksim.planning.profiles`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.hand_collision import hand_pieces
from bt_tasksim.planning.profiles import ConvexSolid, fronts, moved, solids
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.hand import standing_side

LEANS = (0.0, 0.25, 0.5, 0.75)
"""Radians by which the hand may lean back from the vertical: a palm is thicker than the fingers, and would
meet what is taller than these are long."""
CLOSURES = (0.95, 0.8, 0.6)
"""How far a hand of two fingers may be closed: two fingers apart hold what is round from rolling aside."""
TURNS = (0.0, 0.15, -0.15, 0.3, -0.3, 0.45, -0.45, math.pi / 2, -math.pi / 2)
"""Radians by which the hand may be turned about the vertical, or about its own axis where it leans; and by
half a turn more. Its front may be slanted to lie flat on a face of the thing, by less than the angle of
friction."""
AROUND = tuple(k * math.pi / 8 for k in range(16))
"""The same of a hand that pushes with what it holds."""
CLEAR = (0.003, 0.012, 0.35)
"""Metres, least and most, and as a share of the thing's height, at which the pusher is above what the thing
stands on."""
STEP, SPAN, GRID = 0.015, 0.075, 0.0025
"""Metres between cuts; across the way, to either side, that is looked at; and between places there."""
AT, FIRST, FRONT = 0.002, 0.0005, 0.004
"""Metres within which two fronts touch soon, within which they do at first, and within which what a pusher
has in front is its front."""
STEEP = 0.8
"""Share of the distance from a thing's middle to its far edge up to which it may be pushed, over what it
stands on: higher up it would tip over that edge, where friction is 1 over this."""
WIDE, LIKED = 0.04, 0.05
"""Metres of width beyond which more is no better; and what a radian costs by which the hand is turned from
how its arm likes it best."""
GOOD, ENOUGH = 0.0, 24
"""What a stance may cost that is tried before others are looked for; and of the rest, how many are tried."""
FLAT = 1.1
"""The same for what is drawn by its top: its height over that distance."""
LEVEL = 1e-3
"""Metres from a thing's ends at which the first and the last cut are."""
_KEPT = 100
"""Directions of things for which it is remembered how the hand may touch them."""


ACROSS = np.arange(-SPAN, SPAN + GRID / 2, GRID)
"""Places across the way."""


class Stance(NamedTuple):
    """How a pusher stands behind a thing.

    Attributes:
        tool: Tool pose ``(7,)`` in which it touches the thing.
        hand: Joints ``(n_hand,)`` of the hand.
        closure: How far that is closed.
        cost: What speaks against it; the least is best.
        width: Metres over which they touch, as far to one side of the thing's middle as to the other.
    """

    tool: Array
    hand: Array
    closure: float
    cost: float
    width: float


class Pusher(NamedTuple):
    """What pushes: a hand, closed so far, with what it holds, if anything.

    Attributes:
        hand: Joints ``(n_hand,)`` of the hand.
        closure: How far it is closed.
        solids: Its pieces in the tool frame.
    """

    hand: Array
    closure: float
    solids: Sequence[ConvexSolid]


class _Behind(NamedTuple):
    """Where a pusher touches a thing.

    Attributes:
        offset: Where the tool is then ``(3,)`` from the thing's middle, in a frame along the way.
        cost: What speaks against it.
        width: Metres over which they touch, as far to either side of the thing's middle.
    """

    offset: Array
    cost: float
    width: float


class MovedThing(NamedTuple):
    """What is moved, in a frame along the way.

    Attributes:
        heights: Heights ``(h,)`` of the cuts.
        backs: Where its back is there ``(h, g)``; infinite where it is not.
        floor: Height of its lowest point.
        ahead: Metres from its middle to its far edge along the way.
    """

    heights: Array
    backs: Array
    floor: float
    ahead: float


def stances(view: WorldView, target: str, along: Array, held: str | None = None) -> Iterator[Stance]:
    """Ways in which the pusher may stand behind a thing, the best first.

    A hand that leans is asked about where one that leans less serves badly, or where all that was given
    before does not serve.

    Args:
        view: The world.
        target: The thing.
        along: Level unit vector ``(3,)`` of the way.
        held: What the hand holds and pushes with; by default the hand itself does.
    """
    thing, rest = _thing(view, target, along), list[Stance]()
    pushers = list(_pushers(view, held))
    for lean in LEANS if held is None else LEANS[:1]:
        found = _leaning(view, target, thing, along, held, pushers, lean)
        good = [stance for stance in found if stance.cost < GOOD]
        yield from good
        rest += found[len(good) :]
    yield from sorted(rest, key=lambda stance: round(stance.cost, 6))[:ENOUGH]


def tops(view: WorldView, target: str, along: Array) -> list[Stance]:
    """Ways in which a closed hand that points down may stand on the middle of a thing, the best first.

    There are none on what would tip over: what is drawn by its top has to be flat.
    """
    thing = _thing(view, target, along)
    if float(thing.heights[-1]) + LEVEL - thing.floor > FLAT * thing.ahead:
        return []
    robot = view.robot
    closure = CLOSURES[0]
    hand = robot.hand_position(np.array([closure]))
    centre = view.objects[target][:3]
    pieces = solids(pieces_of(view.model(target)), view.objects[target])
    top = max(float(piece.corners[:, 2].max()) for piece in pieces)
    deepest = max(float(piece[:, 2].max()) for piece in hand_pieces(bodies_of(robot), hand))
    position = np.array([centre[0], centre[1], top + deepest])
    quarter = math.pi / 2
    tools = [robot.pointing_down(position, k * quarter) for k in (0, 1, -1, 2)]
    return [Stance(tool, hand, closure, 0.0, 0.0) for tool in tools]


def _leaning(
    view: WorldView,
    target: str,
    thing: MovedThing,
    along: Array,
    held: str | None,
    pushers: Sequence[Pusher],
    lean: float,
) -> list[Stance]:
    """The stances of a hand that leans so far, the best first."""
    heading, middle = _heading(along), view.objects[target][:3]
    found = []
    for pusher, rotation, cost, behind in _contacts(view, thing, along, held, pushers, lean):
        position = middle + poses.rotate(heading, behind.offset)
        cost += behind.cost + 0.2 * (1.0 - pusher.closure)
        found.append(Stance(poses.pose(position, rotation), pusher.hand, pusher.closure, cost, behind.width))
    if held is None and _symmetric(view.robot):
        found += [stance._replace(tool=_half_turned(stance.tool)) for stance in found]
    if held is None:
        turned = [stance.cost + LIKED * _from_neutral(view, stance.tool) for stance in found]
        found = [stance._replace(cost=cost) for stance, cost in zip(found, turned, strict=True)]
    return sorted(found, key=lambda stance: round(stance.cost, 6))


def _contacts(
    view: WorldView,
    thing: MovedThing,
    along: Array,
    held: str | None,
    pushers: Sequence[Pusher],
    lean: float,
) -> list[tuple[Pusher, Array, float, _Behind]]:
    """How pushers that lean so far touch a thing: each with its rotation, and what speaks against that.

    The hand's are kept, since the same is asked again where a tree tries once more.
    """
    turn = poses.pose(np.zeros(3), poses.quat_conjugate(_heading(along)))

    def find() -> list[tuple[Pusher, Array, float, _Behind]]:
        found = []
        for pusher, (rotation, cost) in itertools.product(pushers, list(_rotations(view, along, held, lean))):
            body = moved(pusher.solids, poses.multiply(turn, poses.pose(np.zeros(3), rotation)))
            behind = _behind(thing, body)
            if behind is not None:
                found.append((pusher, rotation, cost, behind))
        return found

    if held is not None:
        return find()
    kept: dict[tuple[bytes, bytes, float], Any] = view.robot.derived("stances", lambda _: {})
    key = thing.backs.tobytes() + thing.heights.tobytes(), along.tobytes(), lean
    if key not in kept:
        if len(kept) >= _KEPT:
            kept.clear()
        kept[key] = find()
    found: list[tuple[Pusher, Array, float, _Behind]] = kept[key]
    return found


def _heading(along: Array) -> Array:
    """The rotation ``(4,)`` that turns the x axis to a level direction ``(3,)``."""
    return poses.yaw(math.atan2(along[1], along[0]))


def _half_turned(tool: Array) -> Array:
    found: Array = poses.multiply(tool, poses.pose(np.zeros(3), poses.yaw(math.pi)))
    return found


def _from_neutral(view: WorldView, tool: Array) -> float:
    """Radians by which a tool pose ``(7,)`` is turned from the one that its arm likes best there."""
    neutral = view.robot.pointing_down(tool[:3])
    return float(poses.angle_between(neutral[None, 3:], tool[None, 3:])[0])


def _thing(view: WorldView, target: str, along: Array) -> MovedThing:
    pose: Array = np.round(view.objects[target], 9)
    pose[:3] = 0.0
    turn = poses.pose(np.zeros(3), poses.quat_conjugate(_heading(along)))
    pieces = solids(pieces_of(view.model(target)), poses.multiply(turn, pose))
    corners = np.concatenate([piece.corners for piece in pieces])
    floor, top = float(corners[:, 2].min()), float(corners[:, 2].max())
    low = floor + clearance(top - floor) + LEVEL
    count = min(max(3, math.ceil((top - low) / STEP)), 6)
    heights = np.linspace(low, top - LEVEL, count)
    back = [piece._replace(corners=piece.corners * [-1.0, 1.0, 1.0]) for piece in pieces]
    return MovedThing(heights, -fronts(back, heights, ACROSS), floor, float(corners[:, 0].max()))


def clearance(height: float) -> float:
    """Metres between a pusher and what a thing of a height stands on."""
    least, most, share = CLEAR
    return min(max(share * height, least), most)


def _pushers(view: WorldView, held: str | None) -> Iterator[Pusher]:
    robot, bodies = view.robot, bodies_of(view.robot)
    if held is not None:
        thing = view.held(held)
        pieces = solids(thing.pieces, thing.grip) + solids(hand_pieces(bodies, view.hand))
        yield Pusher(view.hand, float(robot.closure(view.hand)), pieces)
        return
    for closure in _closures(robot):
        hand = robot.hand_position(np.array([closure]))
        yield Pusher(hand, closure, solids(hand_pieces(bodies, hand)))


def _closures(robot: RobotDescription) -> Sequence[float]:
    return CLOSURES if _symmetric(robot) else CLOSURES[:1]


def _symmetric(robot: RobotDescription) -> bool:
    """It looks the same after half a turn about its approach: two fingers that come towards each other."""
    return not robot.many_fingers and standing_side(robot) is None


def _rotations(view: WorldView, along: Array, held: str | None, lean: float) -> Iterator[tuple[Array, float]]:
    """Rotations ``(4,)`` of the tool, and what speaks against each for itself."""
    if held is not None:
        for turn in AROUND:
            yield poses.quat_multiply(poses.yaw(turn), view.tool[3:]), 0.02 * abs(_wrapped(turn))
        return
    down, across = np.array([0.0, 0.0, -1.0]), np.array([-along[1], along[0], 0.0])
    upright = poses.frame_from_axes(math.cos(lean) * down + math.sin(lean) * along, across)
    halves = (0.0,) if _symmetric(view.robot) else (0.0, math.pi)
    for turn, half in itertools.product(TURNS, halves):
        yield poses.quat_multiply(upright, poses.yaw(turn + half)), 0.3 * lean + 0.1 * abs(turn)


def _wrapped(angle: float) -> float:
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def _behind(thing: MovedThing, body: Sequence[ConvexSolid]) -> _Behind | None:
    """Where a pusher of some pieces touches a thing best; None where it would pass by.

    Its tool is right behind the thing's middle, or the middle of what it has in front is.
    """
    height = thing.heights[0] - LEVEL - min(float(piece.corners[:, 2].min()) for piece in body)
    cuts = thing.heights - height
    reached = fronts(body, cuts, ACROSS)
    if not np.isfinite(reached).any():
        return None
    places = ACROSS[(reached >= reached.max() - FRONT).any(axis=0)]
    middle = float(places.min() + places.max()) / 2
    found = [_touching(thing, reached, 0.0, height)]
    if abs(middle) > GRID:
        found.append(_touching(thing, fronts(body, cuts, ACROSS + middle), middle, height))
    return min((one for one in found if one is not None), key=lambda one: one.cost, default=None)


def _touching(thing: MovedThing, reached: Array, middle: float, height: float) -> _Behind | None:
    """See `_behind`, for a front ``(h, g)`` whose tool is so many metres aside of the thing's middle."""
    both = np.isfinite(thing.backs) & np.isfinite(reached)
    if not both.any():
        return None
    gaps = np.where(both, thing.backs, np.inf) - np.where(both, reached, 0.0)
    least = float(gaps.min())
    where = ACROSS[(gaps <= least + AT).any(axis=0)]
    low = float(thing.heights[(gaps <= least + FIRST).any(axis=1)][0]) - thing.floor
    aside = max(0.0, float(where.min()), -float(where.max()))
    width = 2.0 * max(0.0, min(float(where.max()), -float(where.min())))
    cost = 100.0 * max(0.0, low - STEEP * thing.ahead) + 60.0 * aside - 15.0 * min(width, WIDE)
    return _Behind(np.array([least, -middle, height]), cost, width)
