"""What a learned grasp looks at, and how its actions change the reference motion."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.grasp_memory import GraspMemory
from bt_tasksim.concept_nodes.limits import gentler
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.hand import standing_side

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
RESISTED = 5.0
"""Newtons against the approach from which a hand with a jaw that swings stands on what it touches: its arm
may be so stiff that it presses 100 N before it is held up by `OBSTRUCTED`."""
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
PUSHING = 0.4
"""Share of its speed at which a hand closes one finger of which stands still: the other one pushes what it
meets up to that one, and at its full speed of 0.15 m/s a jaw of the SO-100 strains the wrist with 60 to 120 N
then. As long as it alone touches something it goes slower still, the stiffer its arm is, see `gentler`."""
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
    """The features ``(N, n)``, all of the order of one."""
    local = poses.relative(memory.goal, seen.tool)
    turn = poses.rotation_vector(local[:, 3:])[:, 2:]
    behind = poses.localise(memory.target, seen.tool[:, :3])
    moved = memory.now[:, :3] - memory.start[:, :3]
    pushed = poses.rotate(poses.quat_conjugate(memory.goal[:, 3:]), moved)
    robot, observation = seen.robot, seen.observation
    opened, span = constant(robot.hand_open, seen.tool), constant(_span(robot), seen.tool)
    xp = array_namespace(seen.tool)
    settled = xp.astype(memory.settled, seen.tool.dtype)
    times = (
        poses.clip(seen.elapsed - memory.delay - memory.path.duration, -1.0, 2.0),
        poses.clip(memory.delay, 0.0, 4.0),
        poses.clip(memory.closing, -0.1, 2.0),
        poses.clip(settled / 3.0, 0.0, 2.0),
    )
    parts = [
        local[:, :3] / 0.03,
        turn / 0.2,
        behind / 0.01,
        memory.offset / constant(SCALE, seen.tool),
        (observation.hand_position - opened) / span,
        ((seen.closure - memory.closure) / 0.1)[:, None],
        ((memory.closed - seen.closure) / 0.2)[:, None],
        xp.astype(seen.contacts, seen.tool.dtype),
        memory.touched,
        (memory.first / 0.03)[:, None],
        xp.stack(times, axis=-1),
        memory.estimate,
        pushed / 0.01,
    ]
    return xp.concat(parts, axis=-1)


class Met(NamedTuple):
    """What a motion that takes care has met; booleans ``(N,)``.

    Attributes:
        stands: A finger of the open hand stands on something: it touches, and is held up or pressed back.
        searches: It does, or a finger touches alone while the hand closes.
    """

    stands: Array
    searches: Array


def met(action: Array, seen: Seen, memory: GraspMemory) -> Met:
    """See `Met`; nothing for an action in `HASTE`, and before the straight approach."""
    touching = array_namespace(seen.tool).any(seen.contacts, axis=-1)
    begun = seen.elapsed - memory.delay >= memory.begins
    feels = begun & touching & (action[:, TIME_SCALING] < HASTE)
    ahead = poses.localise(memory.target, seen.tool[:, :3])[:, 2]
    closing = memory.closing >= 0.0
    held_up = ahead < -OBSTRUCTED
    if standing_side(seen.robot) is not None:
        held_up = held_up | (seen.wrench[:, 2] < -RESISTED)
    stands = feels & ~closing & held_up
    return Met(stands, stands | (feels & closing & ~seen.opposed()))


def moved_offset(action: Array, met: Met, seen: Seen, memory: GraspMemory) -> Array:
    """The offsets ``(N, 5)`` one control period on: towards the action, no faster than `RATE`.

    They grow with the square of the action: around its middle a hand that should go straight does, to within
    a fraction of a millimetre, and is not led astray by exploration either. While a finger stands on
    something the hand goes back, towards `WITHDRAWS`. While it searches, the action across the fingers says
    how fast it goes aside, and what it has gone stays (`found_middle`). A way that was searched for is left
    by nothing before the straight approach.
    """
    share = seen.world.control_period / PERIOD
    asked = poses.clip(action[:, :TIME_SCALING], -1.0, 1.0)
    xp, like = array_namespace(memory.offset), memory.offset
    rate, back_rate = constant(RATE, like) * share, constant(_BACK_RATE, like) * share
    gap = (asked * abs(asked) + memory.middle) * constant(SCALE, like) - memory.offset
    gap = gap - xp.astype(met.stands, gap.dtype)[:, None] * (WITHDRAWS * axis(ALONG, gap))
    gap = xp.where(met.searches[:, None] & (axis(ACROSS, gap) > 0.0), asked * rate, gap)
    if memory.path.even is not None:
        coming = memory.path.even & (seen.elapsed - memory.delay < memory.begins)
        gap = xp.where(coming[:, None], xp.zeros_like(gap), gap)
    return memory.offset + poses.clip(gap, -back_rate, rate)


def found_middle(offset: Array, met: Met, memory: GraspMemory) -> Array:
    """The middle ``(N, 5)`` of an action from now on: what a search aside has gone is added to it.

    Args:
        offset: The offsets ``(N, 5)`` from now on, see `moved_offset`.
        met: What was met.
        memory: The grasp's memory.
    """
    gone = (offset - memory.offset) / constant(SCALE, offset) * axis(ACROSS, offset)
    further = poses.clip(memory.middle + gone, -1.0, 1.0)
    return array_namespace(offset).where(met.searches[:, None], further, memory.middle)


def time_scaling(action: Array, met: Met, seen: Seen, memory: GraspMemory) -> Array:
    """Time scaling ``(N,)`` of the reference motion: 1 before the straight approach.

    Then it is 1 for `HASTE`, and for the middle of an action `CAREFUL`, or 0 while a finger stands on
    something.
    """
    xp = array_namespace(memory.delay)
    nothing = xp.zeros_like(memory.delay)
    usual = xp.where(met.stands, nothing, nothing + CAREFUL)
    asked = poses.clip(usual + EAGER * action[:, TIME_SCALING], 0.0, 1.0)
    return xp.where(seen.elapsed - memory.delay >= memory.begins, asked, nothing + 1.0)


def closed(scaling: Array, asked: Array, tightening: float, seen: Seen, memory: GraspMemory) -> Array:
    """The closure ``(N,)`` to command: the preshape, and once the hand closes what is ``asked`` for.

    At a time scaling below 1 the fingers come as much slower than the hand can, and from contact of
    opposing ones on the hand tightens at ``tightening`` of its speed: force grows bit by bit until the
    grasp is done. One finger that comes alone never comes faster than `PUSHING`.
    """
    xp = array_namespace(memory.closed)
    share = xp.where(seen.opposed(), xp.zeros_like(scaling) + tightening, scaling)
    slow = (scaling < 1.0) & (share < 1.0)
    if standing_side(seen.robot) is not None:
        usual = xp.where(slow, share, xp.ones_like(share))
        alone = xp.any(seen.contacts, axis=-1) & ~seen.opposed()
        pushing = PUSHING * xp.where(alone, gentler(seen.tool), xp.ones_like(share))
        share, slow = xp.minimum(usual, pushing), slow | (scaling > 0.0)
    step = share * (seen.robot.hand_speed * seen.world.control_period)
    reached = xp.where(slow, xp.minimum(asked, memory.closed + step), asked)
    return xp.where(memory.closing >= 0.0, reached, memory.preshape)


def displaced(reference: Array, offset: Array) -> Array:
    """Tool poses ``(N, 7)`` on the reference motion, moved by offsets ``(N, 5)`` in the tool's frame."""
    xp = array_namespace(reference)
    half = offset[:, TURN] / 2
    zero = xp.zeros_like(half)
    turn = xp.stack([xp.cos(half), zero, zero, xp.sin(half)], axis=-1)
    return poses.multiply(reference, xp.concat([offset[:, :3], turn], axis=-1))


def axis(number: int, like: Array) -> Array:
    """One of the offsets' axes ``(5,)``, in the library of ``like``."""
    return constant(_AXES[number], like)


_AXES = np.eye(CLOSE + 1)
_BACK_RATE = np.array([BACK_RATE if k == ALONG else rate for k, rate in enumerate(RATE)])


def _span(robot: RobotDescription) -> Array:
    """Range of each hand joint ``(n_hand,)``; 1 where it does not move."""
    span = robot.hand_closed - robot.hand_open
    return span + (span == 0.0)
