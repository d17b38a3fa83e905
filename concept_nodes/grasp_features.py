"""What a learned grasp looks at, and how its actions change the reference motion."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bt_tasksim.concept.context import Seen
from bt_tasksim.concept_nodes.grasp_memory import GraspMemory
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.robot.description import RobotDescription

SIDE, ACROSS, ALONG, TURN, CLOSE, TIME_SCALING = range(6)
ACTIONS = (
    "aside",
    "across the fingers",
    "along the approach",
    "turn about the approach",
    "close",
    "time scaling",
)
"""The first five are offsets from the reference motion; the last one scales that motion's time."""
CAREFUL = 0.2
"""Time scaling of the reference motion that the middle of an action stands for: a slow approach, in which a
first contact can be felt before it presses hard."""
EAGER = 0.1
"""What an action of 1 adds to the time scaling, and one of -1 takes away."""
HASTE = 10.0
"""The action that asks for the reference motion's own speed; a learned policy's, within -1 and 1, cannot."""
WITHDRAWS = 0.02
"""Metres towards which the open hand goes back while a finger stands on something."""
OBSTRUCTED = 0.0015
"""Metres by which a hand that touches something is held up along the approach: it stands on it. Measured:
-2 to 1 mm at the instant of a first contact at `CAREFUL` speed, 2 to 6 mm one control period later."""
SCALE = (0.015, 0.025, 0.035, 0.25, 0.5)
"""Largest offsets: metres along the tool's x (aside), y (the fingers' closing axis) and z (the approach),
radians about z, and of the hand's closure. Source of their order: the released original's grasp training,
which has 0.03 m, 0.01 m and 0.35 rad; the sides are wider here for estimates that are 8 mm off."""
RATE = (0.004, 0.005, 0.0015, 0.04, 0.15)
"""Largest change of these offsets in a control period of 50 ms: exploring actions do not shake the arm, and
it comes down slowly onto what it may meet."""
BACK_RATE = 0.001
"""The same, metres, for the way back against the approach: a finger that stands on an edge is wedged, and
springing free it hits harder than it stood. Measured: of 13 hands that met an edge, 3 exceeded 60 N when they
went back 1 mm in a control period, and 5 or 6 with 2 and 3 mm."""
PERIOD = 0.05
"""Seconds that `RATE` refers to."""


def layout(robot: RobotDescription) -> dict[str, int]:
    """Names and sizes of the features for a robot.

    ``squeeze`` is how far the closure lags behind its command: under the drives' own law that is their
    effort (correlation 0.999 with `Observation.hand_effort`, 0.85 with the true force). So its gap between
    simulation and reality is large, although it is made of two observables with a small one, and a policy
    should not rest on it; policies that were trained with it keep their layout.
    """
    n_hand, n_tips = len(robot.hand_joints), len(robot.tips)
    return {
        "tool from grasp pose": 4,
        "tool behind its target": 3,
        "offsets": 5,
        "hand joints": n_hand,
        "closing speed": 1,
        "squeeze": 1,
        "contacts": n_tips,
        "contacts so far": n_tips,
        "first contact along the approach": 1,
        "time": 4,
        "estimate": 5,
        "object pushed": 3,
    }


def features(seen: Seen, memory: GraspMemory) -> Array:
    """The features ``(..., n)``, all of the order of one."""
    if type(seen.tool) is np.ndarray and seen.tool.ndim == 1:
        return _features_one(seen, memory)
    local = poses.multiply(poses.inverse(memory.goal), seen.tool)
    turn = poses.rotation_vector(local[..., 3:])[..., 2:]
    behind = poses.transform(poses.inverse(memory.target), seen.tool[..., :3])
    pushed = poses.rotate(
        poses.quat_conjugate(memory.goal[..., 3:]), memory.now[..., :3] - memory.start[..., :3]
    )
    robot = seen.robot
    opened, span = constant(robot.hand_open, seen.tool), constant(_span(robot), seen.tool)
    joints = (seen.observation.hand_position - opened) / span
    numbers = (
        (seen.closure - memory.closure) / 0.1,
        (memory.closed - seen.closure) / 0.2,
        memory.first / 0.03,
        poses.clip(seen.elapsed - memory.delay - memory.path.duration, -1.0, 2.0),
        poses.clip(memory.delay, 0.0, 4.0),
        poses.clip(memory.closing, -0.1, 2.0),
        poses.clip(memory.settled / 3.0, 0.0, 2.0),
    )
    xp = array_namespace(seen.tool)
    columns = [xp.astype(n, seen.tool.dtype)[..., None] for n in numbers]
    parts = [
        local[..., :3] / 0.03,
        turn / 0.2,
        behind / 0.01,
        memory.offset / constant(SCALE, seen.tool),
        joints,
        *columns[:2],
        xp.astype(seen.contacts, seen.tool.dtype),
        memory.touched,
        *columns[2:],
        memory.estimate,
        pushed / 0.01,
    ]
    return xp.concat(parts, axis=-1)


def _features_one(seen: Seen, memory: GraspMemory) -> Array:
    """`features` of one grasp, in plain numbers: they are quicker than arrays of one to five."""
    tool, robot = seen.tool, seen.robot
    there, goal = tool.tolist(), memory.goal.tolist()
    x, y, z, *turned = poses.composed(poses.inverted(goal), there)
    turn = float(poses.rotation_vector(np.array(turned))[2])
    behind = poses.point(poses.inverted(memory.target.tolist()), there[:3])
    moved = (memory.now[:3] - memory.start[:3]).tolist()
    pushed = poses.point([0.0, 0.0, 0.0, goal[3], -goal[4], -goal[5], -goal[6]], moved)
    joints = (seen.observation.hand_position - robot.hand_open) / _span(robot)
    closure, delay = float(seen.closure), float(memory.delay)
    late = float(seen.elapsed) - delay - float(memory.path.duration)
    return np.array(
        [
            x / 0.03, y / 0.03, z / 0.03, turn / 0.2,
            *[v / 0.01 for v in behind],
            *[v / scale for v, scale in zip(memory.offset.tolist(), SCALE, strict=True)],
            *joints.tolist(),
            (closure - float(memory.closure)) / 0.1,
            (float(memory.closed) - closure) / 0.2,
            *seen.contacts.tolist(),
            *memory.touched.tolist(),
            float(memory.first) / 0.03,
            min(max(late, -1.0), 2.0),
            min(delay, 4.0),
            min(max(float(memory.closing), -0.1), 2.0),
            min(int(memory.settled) / 3.0, 2.0),
            *memory.estimate.tolist(),
            *[v / 0.01 for v in pushed],
        ]
    )  # fmt: skip


class Met(NamedTuple):
    """What a motion that takes care has met; booleans ``(...)``.

    Attributes:
        stands: A finger of the open hand stands on something: it touches, and is held up.
        searches: It does, or a finger touches alone while the hand closes.
    """

    stands: Array
    searches: Array


def met(action: Array, seen: Seen, memory: GraspMemory) -> Met:
    """See `Met`; nothing for an action in `HASTE`, and before the straight approach."""
    if type(seen.tool) is np.ndarray and seen.tool.ndim == 1:
        begun = float(seen.elapsed) - float(memory.delay) >= float(memory.begins)
        if not begun or action[TIME_SCALING] >= HASTE or True not in seen.contacts.tolist():
            return _NOTHING_MET
        if memory.closing >= 0.0:
            return Met(np.False_, np.bool_(not seen.opposed()))
        ahead = poses.transform(poses.inverse(memory.target), seen.tool[:3])[2]
        return Met(ahead < -OBSTRUCTED, ahead < -OBSTRUCTED)
    xp = array_namespace(memory.delay)
    touching = xp.any(xp.astype(seen.contacts, xp.bool), axis=-1)
    begun = seen.elapsed - memory.delay >= memory.begins
    feels = begun & touching & (action[..., TIME_SCALING] < HASTE)
    ahead = poses.transform(poses.inverse(memory.target), seen.tool[..., :3])[..., 2]
    closing = memory.closing >= 0.0
    stands = feels & ~closing & (ahead < -OBSTRUCTED)
    return Met(stands, stands | (feels & closing & ~xp.asarray(seen.opposed())))


def moved_offset(action: Array, met: Met, seen: Seen, memory: GraspMemory) -> Array:
    """The offsets ``(..., 5)`` one control period on: towards the action, no faster than `RATE`.

    They grow with the square of the action: around its middle a hand that should go straight does, to within
    a fraction of a millimetre, and is not led astray by exploration either. While a finger stands on
    something the hand goes back, towards `WITHDRAWS`. While it searches, the action across the fingers says
    how fast it goes aside, and what it has gone stays (`found_middle`).
    """
    share = seen.world.control_period / PERIOD
    if type(action) is np.ndarray and action.ndim == 1:
        return _moved(action.tolist(), met, share, memory.middle.tolist(), memory.offset.tolist())
    asked = poses.clip(action[..., :TIME_SCALING], -1.0, 1.0)
    xp = array_namespace(memory.offset)
    back_rate, rate = constant(_BACK_RATE, memory.offset), constant(RATE, memory.offset)
    gap = (asked * abs(asked) + memory.middle) * constant(SCALE, memory.offset) - memory.offset
    gap = gap - xp.astype(met.stands, gap.dtype)[..., None] * constant(_BACK, gap)
    gap = xp.where(met.searches[..., None] & (constant(_BESIDE, gap) > 0.0), asked * rate * share, gap)
    return memory.offset + poses.clip(gap, -back_rate * share, rate * share)


def found_middle(offset: Array, met: Met, memory: GraspMemory) -> Array:
    """The middle ``(..., 5)`` of an action from now on: what a search aside has gone is added to it.

    Args:
        offset: The offsets ``(..., 5)`` from now on, see `moved_offset`.
        met: What was met.
        memory: The grasp's memory.
    """
    if met.searches.ndim == 0 and not met.searches:
        return memory.middle
    xp = array_namespace(memory.offset)
    gone = (offset - memory.offset) / constant(SCALE, memory.offset) * constant(_BESIDE, memory.offset)
    return xp.where(met.searches[..., None], poses.clip(memory.middle + gone, -1.0, 1.0), memory.middle)


def time_scaling(action: Array, met: Met, seen: Seen, memory: GraspMemory) -> Array:
    """Time scaling ``(...)`` of the reference motion: 1 before the straight approach.

    Then it is 1 for `HASTE`, and for the middle of an action `CAREFUL`, or 0 while a finger stands on
    something.
    """
    if type(action) is np.ndarray and action.ndim == 1:
        if float(seen.elapsed) - float(memory.delay) < float(memory.begins):
            return np.float64(1.0)
        one = (0.0 if met.stands else CAREFUL) + EAGER * float(action[TIME_SCALING])
        return np.float64(min(max(one, 0.0), 1.0))
    xp = array_namespace(memory.delay)
    asked = poses.clip(xp.where(met.stands, 0.0, CAREFUL) + EAGER * action[..., TIME_SCALING], 0.0, 1.0)
    return xp.where(seen.elapsed - memory.delay >= memory.begins, asked, 1.0)


def closed(scaling: Array, asked: Array, tightening: float, seen: Seen, memory: GraspMemory) -> Array:
    """The closure ``(...)`` to command: the preshape, and once the hand closes what is ``asked`` for.

    At a time scaling below 1 the fingers come as much slower than the hand can, and from contact of
    opposing ones on the hand tightens at ``tightening`` of its speed: force grows bit by bit until the
    grasp is done.
    """
    if type(seen.tool) is np.ndarray and seen.tool.ndim == 1:
        if not memory.closing >= 0.0:
            return memory.preshape
        own = tightening if seen.opposed() else float(scaling)
        if scaling >= 1.0 or own >= 1.0:
            return asked
        further = float(memory.closed) + own * seen.robot.hand_speed * seen.world.control_period
        return np.float64(min(float(asked), further))
    xp = array_namespace(memory.closed)
    share = xp.where(xp.asarray(seen.opposed()), tightening, scaling)
    step = share * seen.robot.hand_speed * seen.world.control_period
    reached = xp.where((scaling < 1.0) & (share < 1.0), xp.minimum(asked, memory.closed + step), asked)
    return xp.where(memory.closing >= 0.0, reached, memory.preshape)


def displaced(reference: Array, offset: Array) -> Array:
    """Tool poses ``(..., 7)`` on the reference motion, moved by offsets ``(..., 5)`` in the tool's frame."""
    if type(offset) is np.ndarray and offset.ndim == 1:
        x, y, z, turn, _ = offset.tolist()
        if abs(x) + abs(y) + abs(z) + abs(turn) < _NOTHING:
            return reference
        return poses.multiply(
            reference, np.array([x, y, z, math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2)])
        )
    xp = array_namespace(reference)
    half = offset[..., TURN] / 2
    zero = xp.zeros_like(half)
    turn = xp.stack([xp.cos(half), zero, zero, xp.sin(half)], axis=-1)
    return poses.multiply(reference, xp.concat([offset[..., :3], turn], axis=-1))


def _moved(action: list[float], met: Met, share: float, middle: list[float], offset: list[float]) -> Array:
    """`moved_offset` for one grasp, in plain numbers."""
    out = []
    for k, scale in enumerate(SCALE):
        asked = min(max(action[k], -1.0), 1.0)
        gap = (asked * abs(asked) + middle[k]) * scale - offset[k]
        if k == ALONG and met.stands:
            gap -= WITHDRAWS
        elif k == ACROSS and met.searches:
            gap = asked * RATE[k] * share
        back = BACK_RATE if k == ALONG else RATE[k]
        out.append(offset[k] + min(max(gap, -back * share), RATE[k] * share))
    return np.array(out)


_NOTHING = 1e-12
_NOTHING_MET = Met(np.False_, np.False_)
_SCALE = np.array(SCALE)
_BACK_RATE = np.array([BACK_RATE if k == ALONG else rate for k, rate in enumerate(RATE)])
_BACK = [WITHDRAWS if k == ALONG else 0.0 for k in range(CLOSE + 1)]
_BESIDE = [float(k == ACROSS) for k in range(CLOSE + 1)]


def _span(robot: RobotDescription) -> Array:
    """Range of each hand joint ``(n_hand,)``; 1 where it does not move."""
    span = robot.hand_closed - robot.hand_open
    return span + (span == 0.0)
