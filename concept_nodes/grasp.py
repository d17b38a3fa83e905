"""Grasp: come to an object, close the hand on it, and notice when it is held."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.demonstrated import coming_from, snapped
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Axis, Direction, Metres, MetresPerSecond, Newtons, ObjectName, Ratio
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes import grasp_features, grasp_programmed
from bt_tasksim.concept_nodes.closer import with_room
from bt_tasksim.concept_nodes.grasp_aims import aims_of, goes_aside
from bt_tasksim.concept_nodes.grasp_approach import ACCELERATION, approach_begins, at_rest, sways, way_out
from bt_tasksim.concept_nodes.grasp_candidates import candidates, narrowest_grip
from bt_tasksim.concept_nodes.grasp_choice import GENTLE, Choice, Chooser, rooms
from bt_tasksim.concept_nodes.grasp_features import ALONG, CLOSE
from bt_tasksim.concept_nodes.grasp_firmness import SLANTED
from bt_tasksim.concept_nodes.grasp_landing import reaches_palm
from bt_tasksim.concept_nodes.grasp_memory import GraspMemory
from bt_tasksim.concept_nodes.grasp_pose import (
    grasp_pose,
    half_extent,
    neutral_rotation,
    on_object,
    resting_place,
)
from bt_tasksim.concept_nodes.holding import EMPTY, HOLDING, tool_distance
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, force_at_wrist, strain
from bt_tasksim.concept_nodes.touching import touched
from bt_tasksim.concept_nodes.view import WorldView, host_numbers, put_down, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.outcomes import Form, Possible, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, NEWTONS, RADIANS, SHARE
from bt_tasksim.core.world import Command
from bt_tasksim.planning.arm import arm_of
from bt_tasksim.planning.reference_motion import at_times, plan, searched_for
from bt_tasksim.planning.route import Pace, Route
from bt_tasksim.planning.routes import SAMPLES, in_postures, joints_along, with_routes
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.hand import standing_side

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
    "hand {closure} closed, {contact}, tool {distance} from {object}, {force} at the wrist{touch}",
    {"closure": SHARE, "distance": METRES, "force": NEWTONS},
)
SETTLED = 3
"""Ticks for which opposing contacts and a still hand must be seen."""
TIGHTENING = 0.2
"""The Panda's fingers press 1 N more in each control period. Measured with the middle of the action and a
fixed number of control periods from opposing contacts on: the Ability hand holds 143 of 150 objects, and at
its full speed 137 to 140, since what is light tilts in it; the Panda 187 and 186 of 200."""
FLATTEST = 0.3
"""Cosine between an approach and straight down onto a support below which a wrong height is corrected less
and less."""
PUSHED = 0.06
"""Metres by which a grasp may push the object, as it is seen."""
TIPPED = math.radians(20.0)
"""Radians by which a grasp may tip the object over, as it is seen, before it holds it. A jaw that swings tips
what stands on a narrow foot by 11 to 13 degrees before its other finger has come, and holds it then."""
TURNED = math.radians(25.0)
"""The same for an object that fingers of both sides have touched: it turns in the hand and does not fall, and
is set upright where it is put down. The Ability hand's fingers roll what is low up between them, while now
one and now another one of them has contact."""
VARIED = 4
"""Grasps that are tried in turn by a leaf that is begun again after it has failed; the usual one is the
first."""
AS_GIVEN = math.cos(math.radians(20.0))
"""Cosine of the angle by which a grasp may differ from the approach or closing axis that its author gave."""


PATIENCE = 8.0
"""Seconds by which a grasp that feels its way may last longer: the ends of a stiff arm's jaws go down
beside what is tall at 4 mm a second."""


class _Asked(NamedTuple):
    """What the choice of a grasp begins with, in one world.

    Attributes:
        usual: Tool pose ``(7,)`` of the usual grasp.
        way: Tool poses ``(7,)`` of the usual way to where its straight approach begins.
        approach: Unit vector ``(3,)`` in which the hand usually comes.
        neutral: The tool's orientation ``(4,)`` in which the arm is at ease there.
        failed: How many grasps are to be passed over.
    """

    usual: Array
    way: list[Array]
    approach: Array
    neutral: Array
    failed: int


class _Chosen(NamedTuple):
    """The grasps of ``N`` worlds.

    Attributes:
        goal: Tool poses ``(N, 7)``.
        standoff: Metres ``(N,)`` before them from which the hand comes straight on.
        tight: Numbers ``(N,)``, 1 where the hand feels its way, see `Choice.tight`.
        known: Numbers ``(N,)``, 1 for a grasp at a known grip, 0 for the usual one.
        closure: How far ``(N,)`` the hand is closed as it comes.
        routes: The motions that lead there, in the worlds where the usual way does not serve.
    """

    goal: Array
    standoff: Array
    tight: Array
    known: Array
    closure: Array
    routes: dict[int, Sequence[Route]]


class GraspMotion(NamedTuple):
    """What an action makes of the reference motion at a tick, in ``N`` worlds.

    Attributes:
        delay: Seconds by which the motion is behind the reference.
        offset: Offsets ``(N, 5)`` from it.
        middle: Offsets that the middle of an action stands for from now on.
        target: Tool pose ``(N, 7)`` to command.
        closed: Closure to command.
        posture: Joints ``(N, n_arm)`` of the arm to command, NaN where they may be any.
    """

    delay: Array
    offset: Array
    middle: Array
    target: Array
    closed: Array
    posture: Array | None


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
    establishes = (ConditionOf("Holding", target="target"),)
    requires = (ConditionOf("Clear", place="target"),)
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
        if bool(xp.any(width > opening)):
            narrowest = [narrowest_grip(view, self.target) for view in views(seen)]
            width = xp.minimum(width, constant(np.array(narrowest), width))
        return unseen, TOO_WIDE.where(width > opening, object=self.target, width=width, opening=opening)

    def begin(self, seen: Seen) -> GraspMemory:
        """Choose the grasp pose and plan the way to it."""
        stand = put_down(seen)  # nothing is in the hand
        usual, found = grasp_pose(stand, self.target, self.approach, self.closing), views(stand)
        goal, standoff, tight, known, closure, routes = self._chosen(stand, usual, found)
        approach = poses.z_axis(goal[:, 3:])
        estimate, xp = self._estimate(seen, goal, approach), array_namespace(goal)
        # Going along a level approach brings the hand no nearer to the height of what stands on its support.
        steep, scale = poses.clip(estimate[:, 3] / FLATTEST, 0.0, 1.0), grasp_features.SCALE[ALONG]
        searched = constant(np.isin(np.arange(len(found)), list(routes)).astype(float), goal)
        support = poses.clip(0.02 * steep * estimate[:, 4] / scale, -1.0, 1.0) * (1.0 - searched)
        # The reference motion goes to where the object is seen, and an action's middle to where it stands.
        goal = poses.shifted(goal, -(scale * support)[:, None] * approach)
        back = poses.shifted(goal, -standoff[:, None] * approach)
        way = [*way_out(seen, back), back, goal]
        path = plan(
            way if len(routes) < len(found) else way[:1],
            self.speed,
            blend=0.03,
            acceleration=ACCELERATION,
            samples=SAMPLES,
        )
        path = with_routes(path, routes, len(seen.robot.arm_joints))
        usual_ways = {k: view.arm for k, view in enumerate(found) if k not in routes}
        path = in_postures(path, joints_along(path, arm_of(seen.robot), usual_ways))
        nothing = xp.zeros_like(path.duration)
        offset = nothing[:, None] * xp.ones((CLOSE + 1,), dtype=goal.dtype, device=goal.device)
        slanted = xp.sqrt(poses.clip(1.0 - estimate[:, 3] ** 2, 0.0, 1.0))
        along = poses.clip(support + SLANTED * (1.0 - known) * slanted / scale, -1.0, 1.0)
        return GraspMemory(
            path=path,
            begins=approach_begins(path, standoff),
            goal=goal,
            delay=nothing,
            middle=along[:, None] * grasp_features.axis(ALONG, goal),
            offset=offset,
            target=seen.tool,
            closing=nothing - 1.0,
            closed=nothing,
            closure=seen.closure,
            settled=xp.astype(nothing, xp.int64),
            preshape=closure,
            tight=tight > 0.5,
            lands=reaches_palm(
                half_extent(seen.object(self.target), seen.model(self.target), approach), seen.robot.depth
            ),
            touched=xp.zeros_like(xp.astype(seen.contacts, goal.dtype)),
            first=nothing,
            estimate=estimate,
            start=seen.observed(self.target),
            now=seen.observed(self.target),
        )

    def _chosen(self, seen: Seen, usual: Array, found: Sequence[WorldView]) -> _Chosen:
        """The grasps, and motions where the usual way does not serve.

        Raises:
            NoWayError: No grasp serves in one of the worlds.
        """
        approach = poses.z_axis(usual[:, 3:])
        back = poses.shifted(usual, -self.standoff * approach)
        neutral = neutral_rotation(seen, approach, usual[:, :3])
        arrays = [usual, back, approach, neutral, *way_out(seen, back)]
        goals, backs, comes, eases, *ways = host_numbers(arrays)
        routes: dict[int, Sequence[Route]] = {}
        standoffs, tight, known, closure = np.empty((4, len(goals)))
        swaying: list[int] = []
        for k, view in enumerate(found):
            failed = 0 if seen.failures is None else int(seen.failures[k])
            asked = _Asked(
                goals[k], [*(way[k] for way in ways), backs[k]], comes[k], eases[k], failed % VARIED
            )
            choice = self._choice(view, asked, seen.later)
            goals[k], standoffs[k] = choice.goal, choice.standoff
            tight[k], known[k], closure[k] = choice.tight, not choice.usual, choice.closure
            if choice.routes:
                routes[k] = choice.routes
            elif sways([*(way[k] for way in ways), backs[k]], goals[k], self.speed):
                swaying.append(k)
        if swaying:
            coming = at_rest([way[swaying] for way in (*ways, backs)], self.speed)
            on = at_rest([backs[swaying], goals[swaying]], self.speed, GENTLE)
            routes |= dict(zip(swaying, zip(coming, on, strict=True), strict=True))
        goal, standoff = constant(goals, usual), constant(standoffs, usual)
        room, known, closed = (constant(values, usual) for values in (tight, known, closure))
        return _Chosen(goal, standoff, room, known, closed, routes)

    def _choice(self, view: WorldView, asked: _Asked, later: Sequence[Any]) -> Choice:
        """The grasp in one world, see `_chosen`."""
        aims = aims_of(view, self.target, later)

        def find(room: tuple[float, bool, bool], thoroughly: bool = False) -> Choice:
            pace = Pace(self.speed)
            chooser = Chooser(view, self.target, self.standoff, pace, aims, *room, thoroughly)
            usual = None
            if self._as_given(asked.usual[None], view)[0]:
                usual = chooser.usual(asked.usual, asked.way)
            if usual is not None and not asked.failed:
                return usual
            others = candidates(view, self.target, asked.approach, asked.neutral)
            _, firmly, _ = room
            swings = firmly and standing_side(view.robot) is not None
            others = others.keeping(~others.poor) if swings else others
            given = self._as_given(others.tools, view)
            chooser.leave_out(int(np.sum(~given)), f"that do not have the {self._given} given")
            return chooser.other(others.keeping(given), asked.failed, usual)

        tried = rooms(view.robot, goes_aside(aims))
        try:
            return with_room(tried, find)
        except NoWayError:
            return find(tried[-1], thoroughly=True)

    @property
    def _given(self) -> str:
        """What the author gave, in words."""
        given = {"approach": self.approach, "closing axis": self.closing}
        return " and the ".join(word for word, value in given.items() if value is not None)

    def _as_given(self, tools: Array, view: WorldView) -> Array:
        """Whether ``(k,)`` tools ``(k, 7)`` have the approach and the closing axis that the author gave."""
        given = np.ones(len(tools), bool)
        if self.approach is not None:
            given &= poses.z_axis(tools[:, 3:]) @ np.array(self.approach) >= AS_GIVEN
        if self.closing is not None:
            axis = poses.rotate(view.objects[self.target][3:], np.array(self.closing))
            across = poses.rotate(tools[:, 3:], np.array([0.0, 1.0, 0.0]))
            given &= abs(across @ axis) >= AS_GIVEN
        return given

    def _estimate(self, seen: Seen, goal: Array, approach: Array) -> Array:
        pose, stands = seen.observed(self.target), resting_place(seen, self.target)
        xp, place = array_namespace(goal), stands.place
        beyond = poses.dot(pose[:, :3] - goal[:, :3], approach)
        up = poses.z_axis(place.pose[:, 3:])
        onto = -poses.dot(up, approach)
        above_goal, height = (poses.dot(p[:, :3] - place.pose[:, :3], up) for p in (goal, pose))
        standing = half_extent(pose, seen.model(self.target), up)
        above = (height - standing) / poses.clip(onto, FLATTEST, math.inf)
        nothing = xp.zeros_like(onto)
        known = xp.stack([above_goal / 0.05, height / 0.05, beyond / 0.05, onto, above / 0.02], axis=-1)
        unknown = xp.stack([nothing, nothing, beyond / 0.05, nothing + 1.0, nothing], axis=-1)
        known_support = stands.found & ~on_object(seen, self.target)
        return xp.where(known_support[:, None], known, unknown)

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
            now=seen.observed(self.target),
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
        reference, arm = at_times(memory.path, seen.elapsed - delay)
        target = grasp_features.displaced(reference, offset)
        closed = grasp_features.closed(scaling, self._asked(offset), self.tightening, seen, memory)
        return GraspMotion(delay, offset, middle, target, closed, arm)

    def _asked(self, offset: Array) -> Array:
        """The closure ``(N,)`` that offsets ``(N, 5)`` ask for in the end."""
        return poses.clip(self.grip + offset[:, CLOSE], 0.0, 1.0)

    def programmed_motion(self, seen: Seen, memory: GraspMemory) -> Array:
        """The middle of an action, at the reference motion's own speed.

        So it has what a learned grasp begins with: an object stands on its support, and where the estimate
        says otherwise, the support is right (`GraspMemory.middle`). Where the fingers have little room beside
        the object it comes no faster than `FEELING`, and a finger that stands on something goes outwards.
        """
        return grasp_programmed.motion(seen, memory, self.target)

    def done(self, seen: Seen, memory: GraspMemory) -> Array:
        """Opposing contacts and a still hand, some ticks long, that presses as hard as it is to."""
        between = seen.closure <= EMPTY * self.grip
        return (memory.settled >= SETTLED) & (memory.closed >= self._asked(memory.offset)) & between

    def planned(self, memory: GraspMemory) -> Array | float:
        """How long the way takes, where it was searched for, and how much longer by feeling."""
        xp = array_namespace(memory.delay)
        felt = poses.clip(memory.delay, 0.0, PATIENCE)
        return searched_for(memory.path) + xp.where(memory.tight, felt, xp.zeros_like(felt))

    def limits(self, seen: Seen, memory: GraspMemory) -> tuple[Limit, ...]:
        """The hand has closed on nothing, presses too hard, or has pushed the object away or over."""
        now, names = seen.observed(self.target), {"object": self.target}
        pushed = poses.norm(now[:, :3] - memory.start[:, :3])
        tipped = poses.tilt(now[:, 3:], memory.start[:, 3:])
        xp, held = array_namespace(tipped), self._gripped(seen, memory)
        most = xp.where(held, xp.full_like(tipped, TURNED), xp.full_like(tipped, TIPPED))
        return (
            Limit(CLOSED_ON_NOTHING, seen.closure, EMPTY * self.grip, counts=memory.closing > 0.8),
            strain(seen, self.force_limit),
            Limit(PUSHED_AWAY, pushed, PUSHED, names),
            Limit(TIPPED_OVER, tipped, most, names),
        )

    def _gripped(self, seen: Seen, memory: GraspMemory) -> Array:
        """Whether ``(N,)`` fingers of both sides touch, or have touched since they came: contacts flicker."""
        xp = array_namespace(memory.touched)
        tips = [[memory.touched[:, k] > 0.0 for k in side] for side in seen.robot.opposition]
        sides = [xp.any(xp.stack(side, axis=-1), axis=-1) for side in tips]
        return seen.opposed() | (xp.all(xp.stack(sides, axis=-1), axis=-1) & (memory.closing >= 0.0))

    def necessary_cost(self, seen: Seen, memory: GraspMemory) -> Array:
        """How far the hand is from holding the object where it stands, from 0 on.

        The mean distance of the fingertips to where they would touch the object, over 0.1 m; 0.3 while
        opposing fingertips have no contact; and how far the object was pushed, over 0.05 m.
        """
        gap = poses.norm(seen.observation.tips - seen.observation.contact_points)
        xp = array_namespace(gap)
        pushed = poses.norm(seen.observed(self.target)[:, :3] - memory.start[:, :3])
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
            touch=touched(seen, self.target),
        )


def _commanded(motion: GraspMotion) -> Command:
    return Command(tool=motion.target, hand=motion.closed[:, None], posture=motion.posture)
