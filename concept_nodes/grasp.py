"""Grasp: come to an object, close the hand on it, and notice when it is held."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.demonstrated import coming_from, snapped
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Axis, Direction, Metres, MetresPerSecond, Newtons, ObjectName, Ratio
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes import grasp_features
from bt_tasksim.concept_nodes.grasp_features import ALONG, CLOSE, HASTE
from bt_tasksim.concept_nodes.grasp_memory import GraspMemory
from bt_tasksim.concept_nodes.grasp_pose import grasp_pose, half_extent, resting_place
from bt_tasksim.concept_nodes.holding import HOLDING, tool_distance
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, force_at_wrist, strain
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Possible, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, NEWTONS, RADIANS, SHARE
from bt_tasksim.core.world import Command
from bt_tasksim.planning.reference_motion import Path, minimum_jerk_time, plan, sample
from bt_tasksim.robot.description import RobotDescription

NOT_SEEN = register_reason("not_seen", "{object} is not seen")
TOO_WIDE = register_reason(
    "too_wide", "{object} is {width} wide, the hand opens {opening}", width=METRES, opening=METRES
)
CLOSED_ON_NOTHING = register_reason(
    "closed_on_nothing",
    "the hand closed on nothing: {value:.3g} closed, above {limit:.3g}",
    value=SHARE,
    limit=SHARE,
)
PUSHED_AWAY = register_reason(
    "pushed_away", "{object} was pushed {value:.3g} away, more than {limit:.3g}", value=METRES, limit=METRES
)
TIPPED_OVER = register_reason(
    "tipped_over", "{object} was tipped by {value}, more than {limit}", value=RADIANS, limit=RADIANS
)
GRASPING = Form(
    "hand {closure} closed, {contact}, tool {distance} from {object}, {force} at the wrist",
    {"closure": SHARE, "distance": METRES, "force": NEWTONS},
)
SETTLED = 3
"""Ticks for which opposing contacts and a still hand must be seen."""
ACCELERATION = 3.0
"""Peak acceleration of the tool on the way to the grasp, m/s^2. It matters where the way is short, as for a
second grasp beside the first one: an arm that is hurried comes to the object beside its path."""
TIGHTENING = 0.2
"""The Panda's fingers press 1 N more in each control period. Measured with the middle of the action and a
fixed number of control periods from opposing contacts on: the Ability hand holds 143 of 150 objects, and at
its full speed 137 to 140, since what is light tilts in it; the Panda 187 and 186 of 200."""
SLANTED = 0.01
"""Metres by which the middle of an action is deeper for a horizontal approach than for one from above: where
a slanted hand meets an object's edge first, its fingers are still before the object's middle."""
EMPTY = 0.97
"""Share of its grip beyond which a hand has nothing between its fingers."""
PUSHED = 0.06
"""Metres by which a grasp may push the object, as it is seen."""
TIPPED = math.radians(10.0)
"""Radians by which a grasp may tip the object over, as it is seen."""


class GraspMotion(NamedTuple):
    """What an action makes of the reference motion at a tick, in ``N`` worlds.

    Attributes:
        delay: Seconds by which the motion is behind the reference.
        offset: Offsets ``(N, 5)`` from it.
        middle: Offsets that the middle of an action stands for from now on.
        target: Tool pose ``(N, 7)`` to command.
        closed: Closure to command.
    """

    delay: Array
    offset: Array
    middle: Array
    target: Array
    closed: Array


@register("concept")
class Grasp(ConceptModel[GraspMemory]):
    """Grasp an object (makes the hand's contacts; the object's own contact with its support is kept).

    The tool comes to a pose above the object (against ``approach``), straight on to the grasp pose, and the
    hand closes along ``closing``. As a task model it is done when opposing fingertips have contact and the
    hand has come to rest.

    As a concept model it does not know the object's shape, mass, friction and true position, and its size
    only as perception tells it. A learned policy moves the tool from this reference motion, says how far to
    close, and when it is enough; what it looks at stands in `grasp_features`.

    Args:
        target: The object.
        approach: Direction in which the tool comes, robot base frame; by default that of the place where
            the object stands.
        closing: Direction in which the fingers close, in the object's frame; by default the best of its
            known grasp axes that fits the hand.
        standoff: How far before the grasp pose the straight approach begins.
        speed: Peak speed of the tool.
        grip: Closure that is commanded when closing; 1 presses as hard as the hand's drives may.
        tightening: Share of the hand's speed at which a learned grasp tightens once opposing fingers have
            contact. Below 1 the force grows bit by bit: done early it is gentle, done late it is firm.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    approach: Direction | None = None
    closing: Axis | None = None
    standoff: Metres = 0.10
    speed: MetresPerSecond = 0.5
    grip: Ratio = 1.0
    tightening: Ratio = TIGHTENING
    force_limit: Newtons = FORCE_LIMIT

    reaches = (HOLDING,)
    default_timeout = 12.0
    is_task_model = False
    contact = ContactChange(ContactState.NC, ContactState.FT, to="hand")
    presentation = Presentation(
        colour="#3b6fb6",
        spoken=r"grasp|grab|grip|take hold|get hold|seiz",
        sayings=("I grasp the {}", "now I grab the {}", "take hold of the {}"),
    )
    actions = len(grasp_features.ACTIONS)
    observables = ("hand_position", "closure", "contacts", "tool_pose", "objects", "time")

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Where the hand comes from."""
        return f"from {coming_from(parameters['approach'])}" if "approach" in parameters else ""

    @classmethod
    def from_task(cls, task: Task, later: Sequence[Task]) -> dict[str, Any]:
        """The approach, where it is not from above; the closing axis is left to the robot's own build."""
        approach = snapped(task.parameters["approach"])
        target = {"target": task.parameters["target"]}
        return target if approach is None else {**target, "approach": approach}

    def initial_state(self, seen: Seen) -> tuple[Possible, ...]:
        """The object must be seen and fit into the hand."""
        xp = array_namespace(seen.tool)
        unseen = NOT_SEEN.where(~xp.isfinite(seen.object(self.target)[:, 0]), object=self.target)
        if self.closing is not None:
            return (unseen,)
        width, opening = xp.min(seen.model(self.target).grasp_widths, axis=-1), seen.world.opening
        return unseen, TOO_WIDE.where(width > opening, object=self.target, width=width, opening=opening)

    def begin(self, seen: Seen) -> GraspMemory:
        """Choose the grasp pose and plan the way to it."""
        goal = grasp_pose(seen, self.target, self.approach, self.closing)
        approach = poses.z_axis(goal[:, 3:])
        back = poses.shifted(goal, -self.standoff * approach)
        way = [*_way_out(seen, back), back, goal]
        path = plan(way, self.speed, blend=0.03, acceleration=ACCELERATION)
        estimate = self._estimate(seen, goal, approach)
        xp = array_namespace(goal)
        nothing = xp.zeros_like(path.duration)
        offset = nothing[:, None] * xp.ones((CLOSE + 1,), dtype=goal.dtype, device=goal.device)
        deeper = SLANTED * xp.sqrt(poses.clip(1.0 - estimate[:, 3] ** 2, 0.0, 1.0))
        along = poses.clip((0.02 * estimate[:, 4] + deeper) / grasp_features.SCALE[ALONG], -1.0, 1.0)
        return GraspMemory(
            path=path,
            begins=_approach_begins(path, self.standoff),
            goal=goal,
            delay=nothing,
            middle=along[:, None] * grasp_features.axis(ALONG, goal),
            offset=offset,
            target=seen.tool,
            closing=nothing - 1.0,
            closed=nothing,
            closure=seen.closure,
            settled=xp.astype(nothing, xp.int64),
            preshape=nothing,
            touched=xp.zeros_like(xp.astype(seen.contacts, goal.dtype)),
            first=nothing,
            estimate=estimate,
            start=seen.object(self.target),
            now=seen.object(self.target),
        )

    def _estimate(self, seen: Seen, goal: Array, approach: Array) -> Array:
        pose, stands = seen.object(self.target), resting_place(seen, self.target)
        xp, place = array_namespace(goal), stands.place
        beyond = poses.dot(pose[:, :3] - goal[:, :3], approach)
        up = poses.z_axis(place.pose[:, 3:])
        onto = -poses.dot(up, approach)
        above_goal, height = (poses.dot(p[:, :3] - place.pose[:, :3], up) for p in (goal, pose))
        standing = half_extent(pose, seen.model(self.target), up)
        above = (height - standing) / poses.clip(onto, 0.3, math.inf)
        nothing = xp.zeros_like(onto)
        known = xp.stack([above_goal / 0.05, height / 0.05, beyond / 0.05, onto, above / 0.02], axis=-1)
        unknown = xp.stack([nothing, nothing, beyond / 0.05, nothing + 1.0, nothing], axis=-1)
        return xp.where(stands.found[:, None], known, unknown)

    @classmethod
    def layout(cls, robot: RobotDescription) -> dict[str, int]:
        """See `grasp_features.layout`."""
        return grasp_features.layout(robot)

    def features(self, seen: Seen, memory: GraspMemory) -> Array:
        """See `grasp_features.features`."""
        return grasp_features.features(seen, memory)

    def decides(self, seen: Seen, memory: GraspMemory) -> Array:
        """From the beginning of the straight approach."""
        return seen.elapsed - memory.delay >= memory.begins

    def command(self, action: Array, seen: Seen, memory: GraspMemory) -> Command:
        """Follow the path with the hand open, then close; both moved by the action's offsets."""
        return _commanded(self._motion(action, seen, memory))

    def advance(self, action: Array, seen: Seen, memory: GraspMemory) -> GraspMemory:
        """Begin to close when the tool has arrived; count the ticks at which the hand holds still."""
        return self._after(self._motion(action, seen, memory), seen, memory)

    def carry_out(self, action: Array, seen: Seen, memory: GraspMemory) -> tuple[Command, GraspMemory]:
        """Both, of the same motion."""
        motion = self._motion(action, seen, memory)
        return _commanded(motion), self._after(motion, seen, memory)

    def _after(self, motion: GraspMotion, seen: Seen, memory: GraspMemory) -> GraspMemory:
        late = seen.elapsed - motion.delay - memory.path.duration
        gap = poses.norm(seen.tool[:, :3] - motion.target[:, :3])
        arrived = (late >= 0.0) & ((gap < self.tolerance) | (late >= 1.0))
        begun = memory.closing >= 0.0
        still = abs(seen.closure - memory.closure) < 0.01
        good = seen.opposed() & still & begun
        along = poses.localise(memory.goal, seen.tool[:, :3])[:, 2]
        xp = array_namespace(seen.tool)
        touched = xp.maximum(memory.touched, xp.astype(seen.contacts, memory.touched.dtype))
        fresh = xp.any(touched > 0.0, axis=-1) & ~xp.any(memory.touched > 0.0, axis=-1)
        go_on = memory.closing + seen.world.control_period
        begins = xp.where(arrived, xp.zeros_like(go_on), memory.closing)
        return memory._replace(
            now=seen.object(self.target),
            delay=motion.delay,
            offset=motion.offset,
            middle=motion.middle,
            target=motion.target,
            closed=motion.closed,
            closing=xp.where(begun, go_on, begins),
            closure=seen.closure,
            settled=xp.where(good, memory.settled + 1, xp.zeros_like(memory.settled)),
            touched=touched,
            first=xp.where(fresh, along, memory.first),
        )

    def _motion(self, action: Array, seen: Seen, memory: GraspMemory) -> GraspMotion:
        """What an action makes of the reference motion at this tick."""
        met = grasp_features.met(action, seen, memory)
        scaling = grasp_features.time_scaling(action, met, seen, memory)
        delay = memory.delay + seen.world.control_period * (1.0 - scaling)
        offset = grasp_features.moved_offset(action, met, seen, memory)
        middle = grasp_features.found_middle(offset, met, memory)
        target = grasp_features.displaced(sample(memory.path, seen.elapsed - delay), offset)
        closed = grasp_features.closed(scaling, self._asked(offset), self.tightening, seen, memory)
        return GraspMotion(delay, offset, middle, target, closed)

    def _asked(self, offset: Array) -> Array:
        """The closure ``(N,)`` that offsets ``(N, 5)`` ask for in the end."""
        return poses.clip(self.grip + offset[:, CLOSE], 0.0, 1.0)

    def programmed_motion(self, seen: Seen, memory: GraspMemory) -> Array:
        """The middle of an action, at the reference motion's own speed.

        So it has what a learned grasp begins with: an object stands on its support, and where the estimate
        says otherwise, the support is right (`GraspMemory.middle`).
        """
        xp = array_namespace(memory.middle)
        still = xp.zeros_like(memory.middle)
        return xp.concat([still, xp.full_like(still[..., :1], HASTE)], axis=-1)

    def done(self, seen: Seen, memory: GraspMemory) -> Array:
        """Opposing contacts and a still hand, some ticks long, that presses as hard as it is to."""
        return (memory.settled >= SETTLED) & (memory.closed >= self._asked(memory.offset))

    def limits(self, seen: Seen, memory: GraspMemory) -> tuple[Limit, ...]:
        """The hand has closed on nothing, presses too hard, or has pushed the object away or over."""
        now, names = seen.object(self.target), {"object": self.target}
        pushed = poses.norm(now[:, :3] - memory.start[:, :3])
        tipped = poses.tilt(now[:, 3:], memory.start[:, 3:])
        return (
            Limit(CLOSED_ON_NOTHING, seen.closure, EMPTY * self.grip, counts=memory.closing > 0.8),
            strain(seen, self.force_limit),
            Limit(PUSHED_AWAY, pushed, PUSHED, names),
            Limit(TIPPED_OVER, tipped, TIPPED, names),
        )

    def necessary_cost(self, seen: Seen, memory: GraspMemory) -> Array:
        """How far the hand is from holding the object where it stands, from 0 on.

        The mean distance of the fingertips to where they would touch the object, over 0.1 m; 0.3 while
        opposing fingertips have no contact; and how far the object was pushed, over 0.05 m.
        """
        gap = poses.norm(seen.observation.tips - seen.observation.contact_points)
        xp = array_namespace(gap)
        pushed = poses.norm(seen.object(self.target)[:, :3] - memory.start[:, :3])
        apart = 0.3 * xp.astype(~seen.opposed(), gap.dtype)
        return poses.mean(gap) / 0.1 + apart + pushed / 0.05

    def sufficient_cost(self, known: Known, memory: GraspMemory) -> Array:
        """1 unless the hand presses on the object."""
        force = known.hand_force(self.target)
        return array_namespace(force).astype(~(force > 0.5), force.dtype)

    def explain(self, seen: Seen, memory: GraspMemory) -> Statement:
        """Contacts, opening and how far the tool is from the object."""
        contacts, tips = seen.contacts, list(enumerate(seen.world.tips))
        touching = [
            [tip for k, tip in tips if bool(contacts[world, k])] for world in range(contacts.shape[0])
        ]
        return GRASPING(
            closure=seen.closure,
            contact=tuple(f"contact at {', '.join(found)}" if found else "no contact" for found in touching),
            distance=tool_distance(seen, self.target),
            object=self.target,
            force=force_at_wrist(seen),
        )


def _commanded(motion: GraspMotion) -> Command:
    return Command(tool=motion.target, hand=motion.closed[:, None])


def _approach_begins(path: Path, standoff: float) -> Array:
    """Seconds ``(N,)`` after which no more than ``standoff`` metres are left of a path."""
    xp, n = array_namespace(path.table), path.table.shape[1]
    left = poses.norm(path.table[:, :, :3] - path.table[:, -1:, :3])
    numbers = xp.astype(xp.arange(1, n + 1, device=left.device), left.dtype)
    fraction = xp.max(xp.astype(left > standoff, left.dtype) * numbers, axis=-1) / (n - 1)
    return minimum_jerk_time(fraction) * path.duration


def _way_out(seen: Seen, goal: Array) -> list[Array]:
    """Waypoints from the present tool pose that keep the hand above what stands around."""
    start = seen.tool
    xp = array_namespace(start)
    level = xp.maximum(start[:, 2], goal[:, 2])
    far = poses.norm(start[:, :2] - goal[:, :2]) > 0.05
    low = (start[:, 2] < level - 0.02) & far & (level < 0.35)
    rise = xp.where(low, level - start[:, 2], xp.zeros_like(level))
    return [start, poses.shifted(start, rise[:, None] * constant([0.0, 0.0, 1.0], start))]
