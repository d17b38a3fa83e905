"""Turn: turn a held thing in the air, by an angle about an axis or to an orientation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.demonstrated import nearest_way
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Direction, MetresPerSecond, Newtons, ObjectName, PlaceName, Radians
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes.closer import BROUGHT, CARRIED, TOUCHING, with_room
from bt_tasksim.concept_nodes.contents import spilling_none
from bt_tasksim.concept_nodes.holding import HOLDING, may_hold, not_held
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, strain
from bt_tasksim.concept_nodes.orientation import UP, missing_lean, missing_turn
from bt_tasksim.concept_nodes.turn_ways import Turning, turnings
from bt_tasksim.concept_nodes.turning import brought, followed_anyhow, swung, turned_by
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.fact_arrays import ObjectFacts
from bt_tasksim.core.outcomes import Form, Possible, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import RADIANS
from bt_tasksim.core.world import Command
from bt_tasksim.planning.arm import LEANS
from bt_tasksim.planning.reach import reach_of
from bt_tasksim.planning.reference_motion import Path, at_times, plan, searched_for
from bt_tasksim.planning.route import Pace, Route, followed
from bt_tasksim.planning.routes import SAMPLES, with_routes
from bt_tasksim.planning.ways import WayFinder

NOT_TURNED = register_reason(
    "not_turned",
    "{object} is {value} from how it should be turned, more than {limit}: it has turned in the hand",
    value=RADIANS,
    limit=RADIANS,
)
TURNS = Form("{object} is {angle:.0f} from how it should be turned", {"angle": RADIANS})

ROOMS = (CARRIED, BROUGHT, TOUCHING)
"""How much closer than usual one may come to things, tried one after the other."""
RATE = 1.0
"""Radians a second at which it is turned."""
TRIED = 6
"""Ways to turn that are tried where it is."""
ELSEWHERE = 60
"""Poses that are looked at where it cannot be turned where it is."""
UPS, ASIDE = (0.0, 0.08, 0.16, 0.24), 0.12
"""Metres that it may then be moved up, and aside, towards the arm or away from it."""
AIMED = (0.1, 0.2)
"""Metres above where it stands at which a grasp is chosen for it."""
FEW = 4
"""Ways to turn for which a grasp is chosen."""
RIGHTING, RIGHTED = 1.5, math.radians(25.0)
"""The share of what is missing by which the hand turns it on in a second, and radians by which it does at
most: what has turned in the hand is made up for."""
CLOSE, OFF = 0.05, math.radians(8.0)
"""Radians within which it is turned as it should be; and that are tolerable."""
RESTS, PATIENCE = 0.3, 2.5
"""Seconds after its way at which it may have come to rest, and after which it has to be turned."""


class TurnMemory(NamedTuple):
    """What a turn remembers in ``N`` worlds.

    Attributes:
        path: Tool path.
        goal: Poses ``(N, 7)`` of the object at its end.
        righted: Rotation vectors ``(N, 3)`` by which the tool is turned from its path, radians.
    """

    path: Path
    goal: Array
    righted: Array


@register("concept")
class Turn(ConceptModel[TurnMemory]):
    """Turn a held object in the air (keeps free space of rotation: NC).

    By ``angle`` about ``axis`` from how it is held, the way round that the sign says; with ``like`` to the
    orientation of a place or another object, turned by ``angle`` about ``axis`` of that; with ``up`` until
    that axis of its own points up, such as upside down with (0, 0, -1). It turns about its middle where the
    arm can lead it so; else it comes to be turned so, near by, any way round. What turns in the hand
    meanwhile is made up for.

    Args:
        target: The held object.
        angle: By how much.
        axis: About which axis: robot base frame, or the frame of ``like``.
        like: The place, or the object, like which it is turned, up to its symmetry.
        up: The axis in its own frame that shall point up, with any heading.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    angle: Radians = 0.0
    axis: Direction = UP
    like: PlaceName | None = None
    up: Direction | None = None
    speed: MetresPerSecond = 0.25
    force_limit: Newtons = FORCE_LIMIT

    maintains = (HOLDING,)
    establishes = (
        ConditionOf("Oriented", target="target", like="like", angle="angle", axis="axis"),
        ConditionOf("PointingUp", target="target", axis="up"),
    )
    requires = (ConditionOf("Lifted", target="target"),)
    contact = ContactChange(ContactState.NC, ContactState.NC, motion="rotation")
    presentation = Presentation(
        colour="#5a6fc0",
        spoken=r"turn .* (?:over|upside|by|about|in the air|on its side)|flip|invert",
        sayings=("I turn the {} over", "turn the {} in the air", "flip the {}"),
    )
    default_timeout = 25.0

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """By how much, or like what."""
        if parameters.get("up"):
            return "until its own axis points up"
        by = math.degrees(parameters.get("angle") or 0.0)
        about = f"by {by:.0f} degrees about {nearest_way(parameters.get('axis', UP))}" if by else ""
        like = f"like {parameters['like']}" if parameters.get("like") else ""
        return ", ".join(filter(None, (like, about)))

    @classmethod
    def from_task(cls, task: Task, later: Sequence[Task]) -> dict[str, Any]:
        """What it was turned by."""
        given = task.parameters
        return {name: given[name] for name in ("target", "angle", "axis", "like", "up") if name in given}

    def contradiction(self) -> str:
        """One way to say how it is turned."""
        if self.like == self.target:
            return "'like' is the object itself"
        if self.up is not None:
            said = [name for name, given in (("angle", self.angle), ("like", self.like)) if given]
            return f"'up' says all of how it is turned: leave out '{said[0]}'" if said else ""
        if self.like is None and self.angle == 0.0:
            return "it turns by nothing: give an 'angle' (rad), or 'like', or 'up'"
        return "" if abs(self.angle) <= math.tau else "'angle' should be a full turn (6.28 rad) at most"

    def initial_state(self, seen: Seen) -> Possible:
        """The object must be in the hand."""
        return not_held(seen, self.target)

    def begin(self, seen: Seen) -> TurnMemory:
        """Find a way to turn it.

        Raises:
            NoWayError: There is none in one of the worlds.
        """
        found = [self._found(view) for view in views(seen)]
        path = plan([seen.tool], self.speed, samples=SAMPLES)  # there is a route in each world
        routes = {k: [route] for k, (route, _) in enumerate(found)}
        path = with_routes(path, routes, len(seen.robot.arm_joints))
        goal = constant(np.array([end for _, end in found]), seen.tool)
        return TurnMemory(path, goal, 0.0 * goal[:, :3])

    def _found(self, view: WorldView) -> tuple[Route, Array]:
        grip = poses.relative(view.objects[self.target], view.tool)
        ways = spilling_none(view, self.target, self._turnings(view, view.objects[self.target]))

        def finder_of(closer: float) -> WayFinder:
            return view.finder([self.target], held=view.held(self.target), closer=closer)

        def here(closer: float) -> tuple[Route, Array]:
            finder = finder_of(closer)
            for way in ways[:TRIED]:
                joints = followed_anyhow(finder, poses.multiply(way.poses, grip[None]))
                if joints is not None:
                    return followed(finder.arm, joints, Pace(self.speed, turn=RATE)), way.poses[-1]
            raise NoWayError(f"the arm cannot turn {self.target} where it is")

        def elsewhere(closer: float) -> tuple[Route, Array]:
            return self._searched(view, finder_of(closer), ways, grip)

        try:
            return with_room(ROOMS, here)
        except NoWayError:
            if self.up is None and self.like is None and abs(self.angle) > math.pi:
                degrees = math.degrees(abs(self.angle))
                raise NoWayError(
                    f"the arm cannot turn {self.target} by {degrees:.0f} degrees about that axis as it holds "
                    f"it: turn it by less, or hold it otherwise"
                ) from None
            return with_room(ROOMS, elsewhere)

    def _searched(
        self, view: WorldView, finder: WayFinder, ways: Sequence[Turning], grip: Array
    ) -> tuple[Route, Array]:
        """A way to near by, any way round."""
        ends = _near(view.tool, np.array([way.poses[-1] for way in ways]))
        far = reach_of(view.robot).beyond(poses.multiply(ends, grip[None]), LEANS)
        near = ends[~far][:ELSEWHERE]
        tools = (poses.multiply(end, grip) for end in near)
        found = brought(finder, tools, Pace(self.speed, turn=RATE))
        if found is None:
            raise NoWayError(
                f"the arm cannot turn {self.target} so as it holds it: of {len(ends)} poses near by there is "
                f"none in which it can hold it with the room that there is; hold it otherwise, or make room"
            )
        route, chosen = found
        return route, near[chosen]

    def _turnings(self, view: WorldView, now: Array) -> list[Turning]:
        if self.up is not None:
            return turnings(now, view.model(self.target), up=np.array(self.up))
        turn = self.angle * np.array(self.axis)
        if self.like is None:
            return [Turning(swung(now, np.sign(self.angle) * np.array(self.axis), now[:3], abs(self.angle)))]
        place = view.world.places.get(self.like)
        frame = view.objects[self.like] if place is None else np.asarray(place.pose)
        should = poses.quat_multiply(frame[3:], poses.from_rotation_vector(turn))
        return turnings(now, view.model(self.target), should=should)

    def aim(self, view: WorldView) -> Aim | None:
        """Above where it stands, and turned from there."""
        now = view.objects[self.target]
        if not np.isfinite(now).all():
            return None
        above = [poses.shifted(now, np.array([0.0, 0.0, height])) for height in AIMED]
        found = [(pose, way.poses) for pose in above for way in self._turnings(view, pose)[:FEW]]
        most = max(2, max(len(way) for _, way in found) // 2)
        onwards = np.array(
            [way[np.round(np.linspace(0, len(way) - 1, most)).astype(int)] for _, way in found]
        )
        first = np.array([pose for pose, _ in found])
        ends = _near(now, onwards[:, -1])
        return Aim(first, "be turned in the air", on_the_way=True, onwards=onwards, aside=ends[:ELSEWHERE])

    def command(self, action: Array, seen: Seen, memory: TurnMemory) -> Command:
        """Follow the path, and turn on at its end by what is missing; the hand keeps its grip."""
        xp = array_namespace(seen.tool)
        tool, arm = at_times(memory.path, seen.elapsed)
        turned = turned_by(tool, memory.righted, memory.goal[:, :3])
        ended = (seen.elapsed >= memory.path.duration)[:, None]
        return Command(tool=xp.where(ended, turned, tool), posture=arm)

    def advance(self, action: Array, seen: Seen, memory: TurnMemory) -> TurnMemory:
        """Note by how much more it has to be turned."""
        xp, period = array_namespace(seen.tool), seen.world.control_period
        more = memory.righted + period * RIGHTING * self._missing(seen, memory)
        ended = seen.elapsed >= memory.path.duration
        now = ended & (poses.norm(more) < RIGHTED)
        return memory._replace(righted=xp.where(now[:, None], more, memory.righted))

    def _missing(self, seen: Seen, memory: TurnMemory) -> Array:
        """Rotation vectors ``(N, 3)`` by which it still has to be turned, radians."""
        return self._off(seen.object(self.target), seen.model(self.target), memory)

    def _off(self, now: Array, model: ObjectFacts, memory: TurnMemory) -> Array:
        return missing_turn(now, memory.goal, model) if self.up is None else missing_lean(now, self.up)

    def planned(self, memory: TurnMemory) -> Array | float:
        """How long the way takes."""
        return searched_for(memory.path)

    def limits(self, seen: Seen, memory: TurnMemory) -> tuple[Limit, ...]:
        """The force at the wrist; and in the end it has to be turned."""
        late = seen.elapsed >= memory.path.duration + PATIENCE
        off = poses.norm(self._missing(seen, memory))
        return strain(seen, self.force_limit), Limit(NOT_TURNED, off, OFF, {"object": self.target}, late)

    def done(self, seen: Seen, memory: TurnMemory) -> Array:
        """It is turned as it should be, and at rest; or nearly, and no more comes of it."""
        late, off = seen.elapsed - memory.path.duration, poses.norm(self._missing(seen, memory))
        return ((late >= RESTS) & (off <= CLOSE)) | ((late >= PATIENCE) & (off <= OFF))

    def maintained(self, goal: str, seen: Seen, memory: TurnMemory) -> Array:
        """The object may still be in the hand."""
        return may_hold(seen, self.target)

    def necessary_cost(self, seen: Seen, memory: TurnMemory) -> Array:
        """Angle from how it should be turned, radians."""
        return poses.norm(self._missing(seen, memory))

    def sufficient_cost(self, known: Known, memory: TurnMemory) -> Array:
        """How far it is truly turned otherwise, over what is tolerable; 10 unless it hangs in the hand."""
        xp, now = array_namespace(known.hidden.tool_pose), known.object(self.target)
        off = poses.norm(self._off(now, known.world.object(self.target), memory))
        free = ~known.supported(self.target) & (known.hand_force(self.target) > 0.2)
        return xp.where(free, off / OFF, xp.full_like(off, 10.0))

    def explain(self, seen: Seen, memory: TurnMemory) -> Statement:
        """How far it is turned otherwise."""
        return TURNS(object=self.target, angle=poses.norm(self._missing(seen, memory)))


def _near(now: Array, ends: Array) -> Array:
    """Poses ``(k, 7)`` turned like some ``(m, 7)``, there and near by, those first that are nearest."""
    back = -now[:2] / max(float(np.linalg.norm(now[:2])), 1e-9)
    ways = [(0.0, 0.0), *((ASIDE * back[0], ASIDE * back[1]), (-ASIDE * back[0], -ASIDE * back[1]))]
    ways += [(ASIDE * back[1], -ASIDE * back[0]), (-ASIDE * back[1], ASIDE * back[0])]
    moves = sorted(((x, y, z) for z in UPS for x, y in ways), key=lambda by: round(math.hypot(*by), 6))
    return np.concatenate([poses.shifted(ends, np.array(by)) for by in moves])
