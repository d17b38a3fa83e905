"""Release: open the hand and draw it back."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Metres, MetresPerSecond, Newtons, ObjectName, PlaceName, Seconds
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.closer import TOUCHING
from bt_tasksim.concept_nodes.holding import HOLDING
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, force_at_wrist, strain
from bt_tasksim.concept_nodes.retreat import Retreat, clear_retreat, little_retreat, retreat_path
from bt_tasksim.concept_nodes.touching import touched
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.concept_nodes.whereabouts import Estimates
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.outcomes import Form, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import COUNT, METRES, NEWTONS, RADIANS, SHARE
from bt_tasksim.core.world import Command
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.hand_collision import HandCollisions
from bt_tasksim.planning.reference_motion import Path, at_times
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.planning.things import Leave, Thing
from bt_tasksim.robot.kinematics.hand import SPARE, opened_about, standing_side, wide_at
from bt_tasksim.scene.spatial_laws import Hollow, beyond_hollow, beyond_opening, floats, is_borne

OPENED = Form(
    "hand {opening} open, {contacts} fingertips in contact, {force} at the wrist{touch}",
    {"opening": SHARE, "contacts": COUNT, "force": NEWTONS},
)


FELL_OVER = register_reason(
    "fell_over",
    "{object} fell over: it is tilted by {value}, more than {limit}",
    value=RADIANS,
    limit=RADIANS,
)
FELL_BESIDE = register_reason(
    "fell_beside",
    "{object} lies {value} beside or above {place}, more than {limit}",
    value=METRES,
    limit=METRES,
)
FALLEN = math.radians(40.0)
"""Radians of tilt from which on something that was let go has fallen over."""
FALLING = 0.6
"""Seconds after the hand has drawn back within which something has fallen."""
OPEN = 0.15
"""Closure, beyond that to which it opens, below which a hand is open; at most a quarter of its way."""
STUCK = 1.0
"""Seconds after it should be open from which on a hand that is not draws back as it opens. Fingers that swing
reach deepest halfway: those of the Ability hand, closed on a bowl on a table, press on the table with 33 N as
they open, and get no farther."""
BARELY = 0.002
"""Metres below a container's rim at which the middle of what leans in it may be above it: estimates are as
wrong as that."""
UNMOVED = (0.01, math.radians(10.0))
"""Metres and radians by which fingers that open move what they let go of, at most."""
PRESSES, PARTED = 0.4, 0.1
"""Share of the force limit from which on a hand whose fingers have parted by so much of their closure draws
back at once as it opens, since they stand on something."""
AT = 0.004
"""Metres within which the hand is at a piece of what it holds, and that it stays away from others."""
UP = np.array([0.0, 0.0, 1.0])
SPARES = (0.006, 0.010, 0.014, 0.018, SPARE)
"""Metres by which a jaw that swings opens wider than what it lets go of, the last where there is room."""
SHUT = (0.0, 0.25, 0.5, 0.75)
"""Shares of its closure that are left of other hands' where they have no room to open all the way."""


class ReleaseMemory(NamedTuple):
    """What a release remembers in ``N`` worlds.

    Attributes:
        path: Tool path away from the object.
        start: Closure ``(N,)`` from which it is told to open.
        held: Closure ``(N,)`` at the begin.
        end: Closure ``(N,)`` to which it opens.
        opened: Seconds ``(N,)`` since the hand was seen open; negative before.
        start_pose: Estimated pose ``(N, 7)`` of the object at the begin.
    """

    path: Path
    start: Array
    held: Array
    end: Array
    opened: Array
    start_pose: Array


@register("concept")
class Release(ConceptModel[ReleaseMemory]):
    """Let an object go (breaks the hand's contacts): the hand opens, then the tool draws back.

    Args:
        target: The held object.
        into: Where it falls, when it is let go above a container; it has to be seen there, if it is seen.
        retreat: How far the tool draws back, against its approach.
        opening: Time in which the hand opens.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    into: PlaceName | None = None
    retreat: Metres = 0.12
    opening: Seconds = 0.4
    speed: MetresPerSecond = 0.3
    force_limit: Newtons = FORCE_LIMIT

    ends = (HOLDING,)
    establishes = (ConditionOf("Inside", target="target", place="into"), ConditionOf("HandEmpty"))
    requires = (ConditionOf("Over", target="target", place="into"),)
    contact = ContactChange(ContactState.FT, ContactState.NC, to="hand")
    presentation = Presentation(
        colour="#c0504d",
        spoken=r"releas|let(?:ting)? .*go|\bdrop|throw|open my hand",
        sayings=("and let go", "release the {}", "I let it go"),
    )
    default_timeout = 8.0
    default_tolerance = 0.01

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Into what, where it falls."""
        return f"into {parameters['into']}" if "into" in parameters else ""

    def begin(self, seen: Seen) -> ReleaseMemory:
        """A straight path back in the arm's own posture, as far as it is clear; or up, where none is."""
        worlds = views(seen)
        opened = [_opened(view, self.target) for view in worlds]
        found = [self._clear(view, hand) for view, hand in zip(worlds, opened, strict=True)]
        path = retreat_path(seen, found, self.speed)
        before = -array_namespace(seen.tool).ones_like(path.duration)
        ends = constant(np.array([float(seen.robot.closure(hand)) for hand in opened]), seen.tool)
        # A hand that presses is told to be farther shut than it can be, and lets go of that first: else
        # fingers that lag differently push what they hold as they part.
        start = array_namespace(before).where(seen.opposed(), -before, seen.closure)
        return ReleaseMemory(path, start, seen.closure, ends, before, seen.object(self.target))

    def _clear(self, view: WorldView, hand: Array) -> Retreat:
        """Where the open hand draws back to, touching nothing; where nothing is clear it only lets go."""
        ways = [-poses.z_axis(view.tool[3:]), UP]
        try:
            return clear_retreat(view, hand, self.retreat, ways, {self.target})
        except NoWayError:
            return little_retreat(view, hand, self.retreat, ways, {self.target})

    def command(self, action: Array, seen: Seen, memory: ReleaseMemory) -> Command:
        """Open, then draw back."""
        share = poses.clip(1.0 - seen.elapsed / self.opening, 0.0, 1.0)
        since = poses.clip(memory.opened, 0.0, math.inf)
        tool, arm = at_times(memory.path, since)
        hand = memory.end + (memory.start - memory.end) * share
        return Command(tool=tool, hand=hand[:, None], posture=arm)

    def advance(self, action: Array, seen: Seen, memory: ReleaseMemory) -> ReleaseMemory:
        """Notice when the hand is open, or opens no farther."""
        xp = array_namespace(seen.tool)
        slack = poses.clip(memory.held - memory.end, 0.0, 4.0 * OPEN) / 4.0
        slack = xp.where(memory.end > 0.0, slack, xp.full_like(slack, OPEN))
        open_now = (seen.elapsed > self.opening) & (seen.closure < memory.end + slack)
        open_now = open_now | (seen.elapsed > self.opening + STUCK)
        parted = seen.closure < memory.held - PARTED
        open_now = open_now | (parted & (force_at_wrist(seen) > PRESSES * self.force_limit))
        begun = xp.where(open_now, xp.zeros_like(memory.opened), memory.opened)
        going = memory.opened >= 0.0
        return memory._replace(opened=xp.where(going, memory.opened + seen.world.control_period, begun))

    def limits(self, seen: Seen, memory: ReleaseMemory) -> tuple[Limit, ...]:
        """The force at the wrist; and the object has fallen over, or beside what it was to fall into."""
        now, names = seen.object(self.target), {"object": self.target}
        if self.into is None:
            tilted = poses.tilt(now[:, 3:], memory.start_pose[:, 3:])
            gone = Limit(FELL_OVER, tilted, FALLEN, names, counts=memory.opened >= 0.0)
        else:
            late = memory.opened > memory.path.duration + FALLING
            gone = Limit(
                FELL_BESIDE, self._beside(seen, memory), 0.0, {**names, "place": self.into}, counts=late
            )
        return strain(seen, self.force_limit), gone

    def _beside(self, seen: Seen, memory: ReleaseMemory) -> Array:
        """Metres ``(N,)`` by which the object's middle is outside what it was to fall into; 0 where unseen.

        What lies on other things above its rim is not in it, unless it stands on its floor. What seems to be
        in the air, or to hang where the hand has let it go, is not seen any more: it is taken for where it
        was last. It is 0 until the hand has drawn back; nobody asks before.
        """
        xp = array_namespace(seen.tool)
        nothing, back = xp.zeros_like(seen.tool[:, 0]), memory.opened >= memory.path.duration
        if self.into is None or self.into not in seen.world.place_columns or not bool(xp.any(back)):
            return nothing
        where = Estimates.of(seen)
        body, hollow = where.body(self.target), where.hollow(self.into)
        far = beyond_hollow(body, _surely(hollow))
        unseen = floats(where, self.target, self.into) | (
            _is_still_at(body.pose, memory.start_pose)
            & (beyond_opening(body, hollow) <= BARELY)
            & ~is_borne(where, self.target)
        )
        return xp.where(back & xp.isfinite(far) & ~unseen, xp.maximum(far, nothing), nothing)

    def done(self, seen: Seen, memory: ReleaseMemory) -> Array:
        """The hand is open, touches nothing and has drawn back; what was to fall into something is in it."""
        gap = poses.norm(seen.tool[:, :3] - memory.path.table[:, -1, :3])
        free = ~array_namespace(gap).any(seen.contacts, axis=-1)
        done = (memory.opened >= memory.path.duration) & (gap < self.tolerance) & free
        return done if self.into is None else done & (self._beside(seen, memory) <= 0.0)

    def necessary_cost(self, seen: Seen, memory: ReleaseMemory) -> Array:
        """Share of the fingertips that still touch something."""
        xp = array_namespace(seen.tool)
        return poses.mean(xp.astype(seen.contacts, seen.tool.dtype))

    def sufficient_cost(self, known: Known, memory: ReleaseMemory) -> Array:
        """1 while the hand still presses on the object."""
        force = known.hand_force(self.target)
        return array_namespace(force).astype(force > 0.05, force.dtype)

    def explain(self, seen: Seen, memory: ReleaseMemory) -> Statement:
        """How far the hand is open and what it touches."""
        return OPENED(
            opening=1.0 - seen.closure,
            contacts=array_namespace(seen.tool).count_nonzero(seen.contacts, axis=-1),
            force=force_at_wrist(seen),
            touch=touched(seen, self.target),
        )


def _is_still_at(pose: Array, before: Array) -> Array:
    """Booleans ``(N,)``: things seem to be where they were, but for what opening fingers move."""
    shifted = poses.norm(pose[:, :3] - before[:, :3])
    return (shifted < UNMOVED[0]) & (poses.angle_between(pose[:, 3:], before[:, 3:]) < UNMOVED[1])


def _surely(hollow: Hollow) -> Hollow:
    """A hollow in which something surely is, see `BARELY`."""
    return hollow._replace(boxes=hollow.boxes - constant([0.0, 0.0, 0.0, 0.0, 0.0, BARELY], hollow.boxes))


def _opened(view: WorldView, target: str) -> Array:
    """Joints ``(n_hand,)`` of the hand that has let go of what it holds.

    One of two sides opens no wider than it may without touching anything else, or another wall of what it
    holds: in the hole of a ring a finger would meet the far side. A jaw that swings sweeps things aside on
    its way, so there each amount has to be clear up to the last; so have many fingers of other walls of what
    they hold, as the spokes of a wheel.
    """
    robot, closure = view.robot, float(view.robot.closure(view.hand))
    walls = _other_walls(view, target)
    if robot.many_fingers and not walls:
        return robot.hand_open
    if robot.many_fingers:
        hands = [robot.hand_position(np.array([share * closure])) for share in SHUT]
        clear = itertools.takewhile(lambda hand: _apart(view, hand, walls), hands[-2::-1])
        return [hands[-1], *clear][-1]
    if standing_side(robot) is None:
        hands = [robot.hand_position(np.array([share * closure])) for share in SHUT]
        return next((hand for hand in hands[:-1] if _has_room(view, target, hand, walls)), hands[-1])
    found = [opened_about(robot, wide_at(robot, closure), spare) for spare in SPARES]
    clear = itertools.takewhile(lambda hand: _has_room(view, target, hand, walls), found[1:])
    return [found[0], *clear][-1]


def _has_room(view: WorldView, target: str, hand: Array, walls: list[Thing]) -> bool:
    """The hand touches nothing where it is, if it is open so far, save the object and what that is about."""
    finder = view.finder(hand=hand, leave=Leave(hand={target}), closer=TOUCHING)
    if not finder.collisions.free(finder.start):
        return False
    return not walls or _apart(view, hand, walls)


def _apart(view: WorldView, hand: Array, walls: list[Thing]) -> bool:
    """The hand would touch no other wall of what it holds."""
    return HandCollisions(bodies_of(view.robot), hand, walls).free(view.tool)


def _other_walls(view: WorldView, target: str) -> list[Thing]:
    """The pieces of what is held that the hand is not at, and a little more about them."""
    bodies, solid = bodies_of(view.robot), pieces_of(view.model(target))
    if len(solid) == 1:
        return []
    pieces = [Thing(target, view.objects[target], pieces=[piece], margin=AT) for piece in solid]
    return [piece for piece in pieces if HandCollisions(bodies, view.hand, [piece]).free(view.tool)]
