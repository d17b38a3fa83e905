"""Spin: turn a held thing about the vertical on what it stands on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.parameters import MetresPerSecond, Newtons, ObjectName, PlaceName, Radians
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.carry import Carry, miss
from bt_tasksim.concept_nodes.closer import CLOSER, TOUCHING, VERY_CLOSE, with_room
from bt_tasksim.concept_nodes.destination import destination, standing_pose
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, strain
from bt_tasksim.concept_nodes.standing import headings, reference_frame
from bt_tasksim.concept_nodes.surface import top_frame
from bt_tasksim.concept_nodes.tipping import support_of
from bt_tasksim.concept_nodes.turning import followed_anyhow, swung
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.fact_arrays import ObjectFacts
from bt_tasksim.core.fact_making import rotations
from bt_tasksim.core.outcomes import Form, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import RADIANS
from bt_tasksim.planning.reference_motion import Path, plan
from bt_tasksim.planning.route import Pace, Route, followed
from bt_tasksim.planning.routes import SAMPLES, with_routes
from bt_tasksim.planning.things import Leave

NOT_LIKE = register_reason(
    "not_spun",
    "{object} is seen {value} from how it should be turned, more than {limit}: it has turned in the hand, "
    "or tips",
    value=RADIANS,
    limit=RADIANS,
)
SPINS = Form("{object} is {angle:.0f} from how it should be turned", {"angle": RADIANS})
ROOMS = (CLOSER, VERY_CLOSE, TOUCHING)
"""How much closer than usual one may come to things, tried one after the other."""
TURN, TURNED = 0.8, 0.03
"""Radians a second at which it is turned, and radians from the end within which the tool has come there."""
OFF = math.radians(6.0)
"""Radians from the heading that are tolerable."""
LIKE, LATE = 0.15, 1.0
"""Radians from the heading up to which it may be seen in the end; and seconds after the end of its way until
which it may still be seen to come there."""
STANDS = math.cos(math.radians(45.0))
"""How much of a turn's effect on what points up has to stay up, for it to count as a turn about that."""
_UP = np.array([0.0, 0.0, 1.0])


class SpinMemory(NamedTuple):
    """What is remembered in ``N`` worlds.

    Attributes:
        path: The tool's path.
        before: Rotation ``(N, 4)`` in which the object was seen at the begin.
    """

    path: Path
    before: Array


@register("concept")
class Spin(Carry[SpinMemory]):
    """Turn a held thing on what it stands on, about the vertical, to a heading (keeps TR of rotation).

    It is not lifted. It ends with the heading of a place, up to its symmetry, either way round, whichever the
    arm can do with the grasp that it has; or it is turned by an angle. The grasp is chosen for that.

    Args:
        target: The held object.
        like: The place, or the object, whose heading it gets.
        angle: By how much it is turned, counterclockwise as seen from above.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    like: PlaceName | None = None
    angle: Radians | None = None
    speed: MetresPerSecond = 0.15
    force_limit: Newtons = FORCE_LIMIT

    establishes = (ConditionOf("TurnedLike", target="target", like="like"),)
    contact = ContactChange(ContactState.TR, ContactState.TR, motion="rotation")
    presentation = Presentation(
        colour="#3f6fb0",
        spoken=r"spin|turn .* (?:round|around|to face)|rotat",
        sayings=("I turn the {} round", "spin it a little"),
    )
    default_timeout = 15.0

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Like what, or by how much."""
        if parameters.get("angle") is not None:
            return f"by {RADIANS.text(float(parameters['angle']))}"
        return f"like {parameters['like']}" if parameters.get("like") else ""

    def contradiction(self) -> str:
        """One goal."""
        return "" if (self.like is None) != (self.angle is None) else "give either 'like' or 'angle'"

    def begin(self, seen: Seen) -> SpinMemory:
        """Find a way round.

        Raises:
            NoWayError: The wrist cannot turn so far in one of the worlds.
        """
        found = [self._found(view) for view in views(seen)]
        path = plan([seen.tool], self.speed, samples=SAMPLES)  # there is a route in each world
        routes = {k: [route] for k, route in enumerate(found)}
        path = with_routes(path, routes, len(seen.robot.arm_joints))
        return SpinMemory(path, seen.object(self.target)[:, 3:])

    def _found(self, view: WorldView) -> Route:
        grip = poses.relative(view.objects[self.target], view.tool)
        ways = self._ways(view)
        if not ways:
            raise NoWayError(
                f"{self.target} does not stand upright, and turning it about the vertical does not bring it "
                f"to the heading of {self.like}: tip it up first"
            )

        def find(closer: float) -> Route:
            leave = Leave(held=frozenset(support_of(view, self.target)[0]))
            finder = view.finder([self.target], held=view.held(self.target), leave=leave, closer=closer)
            for way in ways:
                joints = followed_anyhow(finder, poses.multiply(way, grip[None]))
                if joints is not None:
                    return followed(finder.arm, joints, Pace(self.speed, turn=TURN))
            raise NoWayError(
                f"the arm cannot turn {self.target} {self._words} as it holds it: let it go, and grasp it "
                f"anew for that"
            )

        return with_room(ROOMS, find)

    @property
    def _words(self) -> str:
        return f"like {self.like}" if self.angle is None else f"by {RADIANS.text(self.angle)}"

    def _ways(self, view: WorldView) -> list[Array]:
        """Poses ``(n, 7)`` on each way round, the shortest first."""
        now, model = view.objects[self.target], view.model(self.target)
        if self.like is None:
            assert self.angle is not None, "see `contradiction`"
            return [swung(now, _UP, now[:3], self.angle)]
        frame, _ = reference_frame(view, self.like)
        if model.symmetry == 0 and model.cubic:
            return [swung(now, _UP, now[:3], 0.0)]
        turns = headings() if model.symmetry == 0 else rotations(model)
        goals = poses.quat_multiply(frame[None, 3:], turns)
        angles = about_vertical(now[3:], goals)
        every = np.concatenate([angles, angles - 2 * np.pi * np.sign(angles)])
        if model.symmetry == 0:
            every = np.zeros(min(1, len(every)))
        return [
            swung(now, _UP, now[:3], float(angle))
            for angle in every[np.argsort(np.round(np.abs(every), 6), kind="stable")]
        ]

    def aim(self, view: WorldView) -> Aim | None:
        """From where it is all the way round."""
        ways = self._ways(view)
        if not ways:
            return None
        most = max(len(way) for way in ways)
        onwards = np.array([np.concatenate([way, np.tile(way[-1:], (most - len(way), 1))]) for way in ways])
        now = np.tile(view.objects[self.target], (len(ways), 1))
        supports = frozenset(support_of(view, self.target)[0])
        return Aim(now, f"be turned {self._words}", supports, True, onwards=onwards)

    def done(self, seen: Seen, memory: SpinMemory) -> Array:
        """The tool has come round, and the object is seen to have."""
        turned = poses.angle_between(seen.tool[:, 3:], memory.path.table[:, -1, 3:]) < TURNED
        there = miss(seen, memory.path) < max(self.tolerance, 0.005)
        came = (seen.elapsed >= memory.path.duration) & turned & there
        return came & (self._off(seen, memory) < LIKE)

    def limits(self, seen: Seen, memory: SpinMemory) -> tuple[Limit, ...]:
        """The force at the wrist; and in the end it has to be turned."""
        late = seen.elapsed >= memory.path.duration + LATE
        off = Limit(NOT_LIKE, self._off(seen, memory), LIKE, {"object": self.target}, late)
        return strain(seen, self.force_limit), off

    def _off(self, seen: Seen, memory: SpinMemory) -> Array:
        """Angle ``(N,)`` from how it should be turned, as is seen, radians."""
        if self.like is not None:
            return turned_off(seen, self.target, self.like)
        return self._off_angle(seen.object(self.target), memory.before)

    def explain(self, seen: Seen, memory: SpinMemory) -> Statement:
        """How far it is turned otherwise."""
        return SPINS(object=self.target, angle=self._off(seen, memory))

    def necessary_cost(self, seen: Seen, memory: SpinMemory) -> Array:
        """Angle of the tool from the end of its way, radians."""
        return poses.angle_between(seen.tool[:, 3:], memory.path.table[:, -1, 3:])

    def sufficient_cost(self, known: Known, memory: SpinMemory) -> Array:
        """How far the object is from the heading, over what is tolerable."""
        now, model = known.object(self.target), known.world.object(self.target)
        if self.like is not None:
            if self.like in known.world.place_columns:
                return _from_heading(now, known.place(self.like).pose, model) / OFF
            height = known.world.object(self.like).standing_height
            return _from_heading(now, top_frame(known.object(self.like), height), model) / OFF
        if known.began is None:  # nobody knows how it stood
            return now[:, 0] * 0.0
        before = Known(known.began, known.world).object(self.target)[:, 3:]
        return self._off_angle(now, before) / OFF

    def _off_angle(self, now: Array, before: Array) -> Array:
        """Angle ``(N,)`` of things from how they stood, turned by the angle, radians."""
        assert self.angle is not None, "see `contradiction`"
        turn = poses.from_rotation_vector(constant([0.0, 0.0, self.angle], now))
        goal = poses.quat_multiply(turn + 0.0 * before, before)
        return poses.angle_between(now[:, 3:], goal)


def about_vertical(now: Array, goals: Array) -> Array:
    """Angles ``(n,)`` by which a rotation ``(4,)`` turns into some of ``(k, 4)`` about the vertical, radians.

    Those are left out that it would have to be tipped for: of a cube, which looks the same on each of its
    faces, four of twenty-four are left.
    """
    turns = poses.quat_multiply(goals, poses.quat_conjugate(now[None]))
    turns = turns[poses.rotate(turns, np.tile(_UP, (len(turns), 1)))[:, 2] > STANDS]
    found: Array = 2.0 * np.arctan2(turns[:, 3], turns[:, 0])
    return np.where(np.abs(found) > np.pi, found - 2.0 * np.pi * np.sign(found), found)


def turned_off(seen: Seen, target: str, like: str) -> Array:
    """Angle ``(N,)`` of things from the heading of others, up to their symmetry, radians."""
    return _from_heading(seen.object(target), destination(seen, like)[0], seen.model(target))


def _from_heading(now: Array, frame: Array, model: ObjectFacts) -> Array:
    """Angle ``(N,)`` of poses ``(N, 7)`` from how frames are turned, up to symmetry; a ball's is 0."""
    off = poses.angle_between(now[:, 3:], standing_pose(frame, now, model)[:, 3:])
    return array_namespace(off).where(model.ball, 0.0 * off, off)
