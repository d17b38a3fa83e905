"""The law of all tasks that move a part of furniture along its joint: the hand that holds it goes along."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import ClassVar, NamedTuple

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import MetresPerSecond, Newtons, ObjectName
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.closer import TOUCHING, VERY_CLOSE, with_room
from bt_tasksim.concept_nodes.handle import NO_PART, OTHER_PART, about_handle, at_handle
from bt_tasksim.concept_nodes.holding import HOLDING, NOT_HELD, off_handle
from bt_tasksim.concept_nodes.joint_way import JointWay, gone_anyhow, keeps_clear, pivots
from bt_tasksim.concept_nodes.limits import force_at_tool, force_at_wrist, strain
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.joints import JointModel, Joints
from bt_tasksim.core.outcomes import Form, Possible, Reason, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.transfer import fetched
from bt_tasksim.core.units import METRES, NEWTONS, RADIANS, Unit
from bt_tasksim.core.world import Command
from bt_tasksim.planning.reference_motion import Path, at_times, plan, searched_for
from bt_tasksim.planning.route import Pace, Route, followed
from bt_tasksim.planning.routes import SAMPLES, with_routes
from bt_tasksim.planning.ways import WayFinder

UNITS: Mapping[bool, Unit] = {False: METRES, True: RADIANS}
"""Of what a part does, by whether it turns."""


def _by_kind(name: str, sentence: str, *numbers: str) -> dict[bool, Reason]:
    """A reason for what slides and one for what turns, which have other units.

    Args:
        name: Of both.
        sentence: With fields for the object and for numbers.
        numbers: Names of the numbers, ``value`` and ``limit`` by default.
    """
    return {
        turns: register_reason(
            f"{name}_{'turning' if turns else 'sliding'}",
            sentence,
            **dict.fromkeys(numbers or ("value", "limit"), unit),
        )
        for turns, unit in UNITS.items()
    }


def _form(turns: bool) -> Form:
    unit = UNITS[turns]
    return Form(
        "{object} is open by {value}, and should be by {wanted}; {force} at the wrist",
        {"value": unit, "wanted": unit, "force": NEWTONS},
    )


JAMMED = _by_kind("jammed", "{object} does not follow the hand: it is {value} behind, more than {limit}")
NOT_THERE = _by_kind("stopped_short", "{object} stopped {value} from where it should be, more than {limit}")
TOO_FAR = _by_kind(
    "beyond_the_way",
    "{object} should come to {wanted}, and it goes from {low} to {high} only",
    *("wanted", "low", "high"),
)
STANDS = {turns: _form(turns) for turns in UNITS}
SOFT, HARD = 0.5, 0.9
"""Shares of the force limit between which the hand goes slower and slower, until it stands."""
BEYOND = {False: 0.008, True: math.radians(2.5)}
"""Metres or radians beyond the stop to which the hand goes unless it feels it before."""
BEHIND = {False: 0.04, True: math.radians(10.0)}
"""Metres or radians by which a part may be behind the hand."""
PATIENCE, LATE = 1.0, 2.5
"""Seconds for which it may be farther behind, and after the way's end until which it may come there."""
ROUND = 0.01
"""Metres from the axis within which a hand turns about itself rather than that it goes somewhere."""
YIELDS, UNFELT, MOST = 3e-5, 3.0, 0.012
"""Metres a second for each newton from aside with which the hand gives way, newtons that it does not mind,
and metres that it gives way at most: no hinge is quite where it is taken to be. Where an arm is near to the
end of its reach, its drives resist a step with up to 500 N/mm: any faster, it would swing."""
RELAXES = 1.0
"""Share of what the tool is held aside of where it is told to be, in which it gives way in a second: where an
arm is soft, that is more than what `YIELDS` says."""
PUSHES = 2.0
"""Share of what is missing at the way's end that the hand goes on in a second: arms and fingers give way to
friction."""
FURTHER = {False: 0.03, True: math.radians(20.0)}
"""Metres or radians by which it does so at most."""
TOLERANCE = {False: 0.004, True: math.radians(1.5)}
"""Metres or radians within which a value counts as reached."""
CLOSELY, IN_TIME = {False: 0.001, True: math.radians(0.4)}, 1.6
"""The same within which it counts so at once, and seconds after the way's end from which on `TOLERANCE` will
do: fingers that give way to friction come closer as the hand goes on."""
ALLOWED = {False: 0.02, True: math.radians(8.0)}
"""Metres or radians from the wanted value that are tolerable."""
ACCELERATION = 0.4
"""Peak acceleration of the tool, m/s^2."""
TURN = 0.5
"""Peak turning rate of the tool, rad/s."""
ROOMS = (VERY_CLOSE, TOUCHING)
"""How much closer than usual the arm may come to things, tried one after the other."""
SHARES = (1.0, 0.95, 0.9, 0.85)
"""Shares of the whole way that are tried where the arm cannot go all of it, and all of it was meant."""


class JointMemory(NamedTuple):
    """What such a task remembers in ``N`` worlds.

    Attributes:
        path: Tool path along the joint.
        grip: Pose ``(N, 7)`` of the part in the tool frame.
        goal: Value ``(N,)`` that is wanted, metres or radians.
        begun: Value ``(N,)`` when it began.
        start: Where the tool was then ``(N, 3)``.
        pivots: Booleans ``(N,)``: the part turns between the fingers, as `joint_way.PIVOTS` says.
        offset: Metres ``(N, 3)`` by which the hand has given way aside, robot base frame.
        further: Metres or radians ``(N,)`` of the joint beyond the path's end to which the hand goes, since
            the part has stayed behind it.
        progress: Seconds ``(N,)`` of the path that have been commanded.
        felt: Ticks ``(N,)`` in a row with the stop's force.
        behind: Seconds ``(N,)`` in a row for which the part was far behind the hand.
        late: Seconds ``(N,)`` since the path's end, or for which force has held the hand up before it.
    """

    path: Path
    grip: Array
    goal: Array
    begun: Array
    start: Array
    pivots: Array
    offset: Array
    further: Array
    progress: Array
    felt: Array
    behind: Array
    late: Array


class OnJoint(ConceptModel[JointMemory]):
    """A task in which the hand holds ``target``, a part of furniture, and takes it along its joint."""

    target: ObjectName
    speed: MetresPerSecond
    force_limit: Newtons

    turns: ClassVar[bool] = False
    """It is a task of what turns, and not of what slides."""
    maintains = (HOLDING,)
    default_timeout = 20.0

    def wanted(self, now: Array, limits: Array) -> Array:
        """The value ``(N,)`` at which it should end, whether the part goes as far or not.

        Args:
            now: The present one ``(N,)``.
            limits: Lowest and highest ``(N, 2)``.
        """
        raise NotImplementedError

    @property
    def stops(self) -> int:
        """-1 or 1: it ends where the part is felt to be stopped, at the lower or the upper end; else 0."""
        return 0

    @property
    def wholly(self) -> bool:
        """The end of the way is not given: less of it will do where the arm cannot go all of it."""
        return False

    def initial_state(self, seen: Seen) -> tuple[Possible, ...]:
        """The part must move as this task has it, and as far, and its handle be in the hand."""
        model = seen.model(self.target)
        away, limits = off_handle(seen, self.target), model.joints.limits
        now = self._value(seen)
        names = {"object": self.target, "wanted": self.wanted(now, limits)}
        names |= {"low": limits[:, 0], "high": limits[:, 1]}
        return (
            NO_PART.where(~model.jointed, object=self.target),
            OTHER_PART[self.turns].where(model.joint_turns != self.turns, object=self.target),
            TOO_FAR[self.turns].where(self._beyond(now, limits), **names),
            NOT_HELD.where(~at_handle(seen, self.target), object=self.target, distance=away),
        )

    def begin(self, seen: Seen) -> JointMemory:
        """The way of hand and arm along the joint, to its end.

        Raises:
            NoWayError: The arm cannot go there in one of the worlds.
        """
        xp, now = array_namespace(seen.tool), self._value(seen)
        limits = seen.model(self.target).joints.limits
        (goals, values) = (np.asarray(v, float) for v in fetched([self._end(now, limits), now]))
        found = [self._way(view, values[k], goals[k]) for k, view in enumerate(views(seen))]
        path = plan([seen.tool], self.speed, samples=SAMPLES)
        path = with_routes(
            path, {k: [route] for k, (_, route, _) in enumerate(found)}, len(seen.robot.arm_joints)
        )
        nothing = xp.zeros_like(path.duration)
        return JointMemory(
            path=path,
            grip=poses.relative(seen.tool, seen.object(self.target)),
            goal=poses.constant(np.array([goal for goal, _, _ in found]), now),
            begun=now,
            start=seen.tool[:, :3],
            pivots=poses.constant(np.array([pivot for _, _, pivot in found]), seen.contacts),
            offset=0.0 * seen.tool[:, :3],
            further=nothing,
            progress=nothing,
            felt=xp.astype(nothing, xp.int64),
            behind=nothing,
            late=nothing,
        )

    def _way(self, view: WorldView, now: float, goal: float) -> tuple[float, Route, bool]:
        """The value at the end, the motion, and whether the part turns in the hand, in one world."""
        if view.model(self.target).joint is None:
            raise NoWayError(NO_PART(object=self.target).sentence)
        way, shares = JointWay(view, self.target), SHARES if self.wholly else SHARES[:1]
        pace, met = Pace(self.speed, TURN, ACCELERATION), way.met(now, goal)

        def find(asked: tuple[float, float, float]) -> tuple[float, Route, bool]:
            share, closer, pivot = asked
            end = now + share * (goal - now)
            if met is not None and abs(end - now) > abs(met[0] - now):
                last = UNITS[self.turns].text(met[0])
                raise NoWayError(
                    f"{self.target} can only be moved to {last}, since {met[1]} is in its way: make room"
                )
            beyond = self.stops * BEYOND[self.turns] if share == 1.0 else 0.0
            parts = way.poses(now, end + beyond)
            finder = way.alone(closer) if pivot else way.finder(view.tool, closer)
            joints = gone_anyhow(finder, way.tools(view.tool, parts, pivot))
            if joints is None:
                raise NoWayError(self._why_not(way, finder, view, now, end))
            if pivot and not keeps_clear(view, self.target, parts, joints[-len(parts) :]):
                raise NoWayError(
                    f"the arm would meet {self.target} as it turns in the hand: take it otherwise"
                )
            return end, followed(finder.arm, np.concatenate([finder.start[None], joints]), pace), pivot > 0.0

        turning = pivots(view, self.target, view.tool)
        asked = itertools.product(shares, ROOMS, turning)
        return with_room(asked, find)

    def _why_not(self, way: JointWay, finder: WayFinder, view: WorldView, now: float, end: float) -> str:
        """What would be touched, or how far the arm can go along, in one sentence."""
        along = finder.arm.along(finder.start, way.tools(view.tool, way.poses(now, end)))
        touch = (
            None if along is None else next((t for q in along for t in finder.collisions.touches(q)), None)
        )
        if touch is not None:
            what = f"{touch[0]} would touch {touch[1]}"
            return f"{self.target} cannot be moved: {what} on the way: make room there"
        last, joints = now, finder.start
        for value in np.linspace(now, end, 21)[1:]:
            tools = way.tools(view.tool, way.poses(last, float(value)))
            after = finder.arm.along(joints, tools)
            if after is None:
                break
            last, joints = float(value), after[-1]
        unit = UNITS[self.turns]
        return (
            f"the arm cannot go along with {self.target} farther than to {unit.text(last)}, and "
            f"{unit.text(end)} are wanted: take it otherwise, or move it less"
        )

    def aim(self, view: WorldView) -> Aim | None:
        """All of the way from where the part is; none where it is asked farther than it goes."""
        if view.model(self.target).joint is None:
            return None
        way = JointWay(view, self.target)
        joint = view.model(self.target).joint
        assert joint is not None
        now, limits = np.array([way.now]), np.array([joint.limits])
        if bool(self._beyond(now, limits)[0]):
            return None  # says so itself when its turn comes, which no grasp should be blamed for
        goal = float(self._end(now, limits)[0])
        if self.wholly:
            goal = way.now + SHARES[-1] * (goal - way.now)
        unit = UNITS[self.turns]
        words = f"be taken from {unit.text(way.now)} to {unit.text(goal)}"
        beyond = self.stops * BEYOND[self.turns]
        return Aim(way.poses(way.now, goal + beyond), words, way.beside, along=True, carried=way.carried)

    def _end(self, now: Array, limits: Array) -> Array:
        """The wanted value ``(N,)``, as far as the part goes."""
        return poses.clip(self.wanted(now, limits), limits[:, 0], limits[:, 1])

    def beyond_its_way(self, joint: JointModel) -> str:
        """What is wrong with asking it of a part with such a joint, wherever that stands; else nothing."""
        if joint.turns != self.turns:  # which is refused as such, and has other units
            return ""
        low, high = joint.limits
        now = np.array([low, (low + high) / 2, high])
        limits = np.tile([low, high], (3, 1))
        if not self._beyond(now, limits).all():
            return ""
        wanted = float(self.wanted(now, limits)[0])
        return TOO_FAR[self.turns](object=self.target, wanted=wanted, low=low, high=high).sentence

    def _beyond(self, now: Array, limits: Array) -> Array:
        """Boolean ``(N,)``: the part is asked farther than it goes."""
        return abs(self.wanted(now, limits) - self._end(now, limits)) > TOLERANCE[self.turns]

    def _law(self, seen: Seen) -> Joints:
        return seen.model(self.target).joints

    def _value(self, seen: Seen) -> Array:
        """How far ``(N,)`` the part is taken to be open."""
        return self._law(seen).value(seen.object(self.target))

    def _ahead(self, seen: Seen, memory: JointMemory) -> Array:
        """Sign ``(N,)`` of what is missing to the wanted value; of a stop, to a little beyond it."""
        missing = memory.goal - self._value(seen) + self.stops * BEYOND[self.turns]
        return array_namespace(missing).sign(missing)

    def _along(self, seen: Seen, memory: JointMemory) -> Array:
        """Unit vectors ``(N, 3)`` in which the tool goes now; shorter where it turns about itself."""
        now, law, ahead = self._value(seen), self._law(seen), self._ahead(seen, memory)
        step = 0.01
        there = poses.multiply(law.pose(now + step * ahead), poses.inverse(memory.grip))
        here = poses.multiply(law.pose(now), poses.inverse(memory.grip))
        moved = there[:, :3] - here[:, :3]
        long = poses.norm(moved)
        return moved / poses.clip(long, ROUND * step, math.inf)[:, None]

    def advance(self, action: Array, seen: Seen, memory: JointMemory) -> JointMemory:
        """Go on, slower where the wrist feels force, and give way aside; notice stops, and what jams."""
        xp, period = array_namespace(seen.tool), seen.world.control_period
        share = self._share(seen, memory)
        progress = memory.progress + period * share
        far = abs(self._asked(seen, memory) - self._value(seen)) > BEHIND[self.turns]
        at_end = (memory.late > 0.0) & (share > 0.0) & (memory.progress >= memory.path.duration)
        on = period * self._goes_on(seen, memory)
        further = memory.further + xp.where(at_end, on, xp.zeros_like(on))
        over = (progress >= memory.path.duration) | (share <= 0.0)
        return memory._replace(
            offset=self._given_way(seen, memory),
            further=poses.clip(further, -FURTHER[self.turns], FURTHER[self.turns]),
            progress=xp.minimum(progress, memory.path.duration),
            felt=self._felt(seen, memory),
            behind=xp.where(far, memory.behind + period, xp.zeros_like(memory.behind)),
            late=xp.where(over, memory.late + period, xp.zeros_like(memory.late)),
        )

    def _goes_on(self, seen: Seen, memory: JointMemory) -> Array:
        """Metres or radians of the joint a second ``(N,)`` by which the hand goes on after the path's end."""
        return PUSHES * (memory.goal - self._value(seen))

    def _share(self, seen: Seen, memory: JointMemory) -> Array:
        """Share ``(N,)`` of the path's own speed: less where the wrist feels force."""
        strained = force_at_wrist(seen) / self.force_limit
        return poses.clip((HARD - strained) / (HARD - SOFT), 0.0, 1.0)

    def _given_way(self, seen: Seen, memory: JointMemory) -> Array:
        """Metres ``(N, 3)`` by which the hand has given way aside then, as what presses it asks."""
        force, along = force_at_tool(seen), self._along(seen, memory)
        aside = force - poses.dot(force, along)[:, None] * along
        minds = poses.clip(1.0 - UNFELT / poses.clip(poses.norm(aside), 1e-9, math.inf), 0.0, 1.0)
        behind = seen.tool[:, :3] - self._led(seen, memory)[0][:, :3]
        behind = behind - poses.dot(behind, along)[:, None] * along
        give = (seen.world.control_period * minds)[:, None] * (YIELDS * aside + RELAXES * behind)
        offset = memory.offset + give
        return offset * poses.clip(MOST / poses.clip(poses.norm(offset), 1e-9, math.inf), 0.0, 1.0)[:, None]

    def _felt(self, seen: Seen, memory: JointMemory) -> Array:
        """Ticks ``(N,)`` in a row for which a stop is felt, with this one: only some tasks go by that."""
        return 0 * memory.felt

    def command(self, action: Array, seen: Seen, memory: JointMemory) -> Command:
        """Follow the path, aside of it where the hand gives way, and on beyond its end; it keeps its grip."""
        tool, arm = self._led(seen, memory)
        return Command(tool=tool, posture=arm)

    def _led(self, seen: Seen, memory: JointMemory) -> tuple[Array, Array]:
        """Tool poses ``(N, 7)`` now, and the arm's joints ``(N, n_arm)`` on the path."""
        tool, arm = at_times(memory.path, memory.progress)
        law = self._law(seen)
        on = poses.multiply(law.pose(memory.goal + memory.further), poses.inverse(law.pose(memory.goal)))
        return poses.shifted(poses.multiply(on, tool), memory.offset), arm

    def _asked(self, seen: Seen, memory: JointMemory) -> Array:
        """The value ``(N,)`` that the hand asks for now on its path."""
        tool, _ = at_times(memory.path, memory.progress)
        law, xp = self._law(seen), array_namespace(seen.tool)
        held = law.value(poses.multiply(tool, memory.grip))
        gone = memory.begun + law.shift(memory.begun, memory.start, tool[:, :3])
        return xp.where(memory.pivots, gone, held)

    def planned(self, memory: JointMemory) -> Array | float:
        """How long the way takes."""
        return searched_for(memory.path)

    def limits(self, seen: Seen, memory: JointMemory) -> tuple[Limit, ...]:
        """The force at the wrist; a part that does not follow; one that stopped short."""
        names = {"object": self.target}
        now, asked = self._value(seen), self._asked(seen, memory)
        off = abs(now - memory.goal)
        return (
            strain(seen, self.force_limit),
            Limit(JAMMED[self.turns], abs(asked - now), BEHIND[self.turns], names, memory.behind >= PATIENCE),
            Limit(NOT_THERE[self.turns], off, TOLERANCE[self.turns], names, memory.late >= LATE),
        )

    def done(self, seen: Seen, memory: JointMemory) -> Array:
        """The hand has come to the end of its way, and the part to its value."""
        off = abs(self._value(seen) - memory.goal)
        close = (off <= CLOSELY[self.turns]) | ((off <= TOLERANCE[self.turns]) & (memory.late >= IN_TIME))
        return (memory.progress >= memory.path.duration) & close

    def maintained(self, goal: str, seen: Seen, memory: JointMemory) -> Array:
        """The handle may still be in the hand."""
        return about_handle(seen, self.target)

    def necessary_cost(self, seen: Seen, memory: JointMemory) -> Array:
        """How far the value is from the wanted one, metres or radians."""
        return abs(self._value(seen) - memory.goal)

    def sufficient_cost(self, known: Known, memory: JointMemory) -> Array:
        """How far the part truly is from the wanted value, over what a goal allows."""
        law = known.world.object(self.target).joints
        off = abs(law.value(known.object(self.target)) - memory.goal)
        return off / ALLOWED[self.turns]

    def explain(self, seen: Seen, memory: JointMemory) -> Statement:
        """How far it is, how far it should be, and the force at the wrist."""
        return STANDS[self.turns](
            object=self.target, value=self._value(seen), wanted=memory.goal, force=force_at_wrist(seen)
        )
