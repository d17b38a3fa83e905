"""Bring: carry a held object through free space to a place, clear of everything on the way."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.demonstrated import position_words, rounded, rounded_points
from bt_tasksim.concept.parameters import (
    Flag,
    Metres,
    MetresPerSecond,
    Newtons,
    ObjectName,
    PlaceName,
    Points,
    Position,
)
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes.carried_way import CarriedWay, ProposedWay, WayEnds, way_over
from bt_tasksim.concept_nodes.carry import Carry, MoveMemory
from bt_tasksim.concept_nodes.closer import BROUGHT, CARRIED, TOUCHING
from bt_tasksim.concept_nodes.destination import destination, standing_pose
from bt_tasksim.concept_nodes.drops import lies_in, preferred_options
from bt_tasksim.concept_nodes.grasp_pose import neutral_rotation, place_below, resting_place
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT
from bt_tasksim.concept_nodes.spots import GAP, Spots, spots_beside, spots_on
from bt_tasksim.concept_nodes.standing import aside_options, supports_of
from bt_tasksim.concept_nodes.view import WorldView, host_numbers, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.planning.arm import arm_of
from bt_tasksim.planning.reference_motion import plan
from bt_tasksim.planning.route import Pace, Route
from bt_tasksim.planning.routes import SAMPLES, hurried, in_postures, joints_along, with_routes

HOVERS = (0.03, 0.12)
"""Metres between which the height lies that is taken over from a demonstration."""
SPOT_ROOMS = (CARRIED, CARRIED), (CARRIED, BROUGHT), (BROUGHT, BROUGHT), (BROUGHT, TOUCHING)
"""The same two closenesses over and on free spots, for all of which one is tried before the next."""
LOWER = (1.0, 0.4, 0.15)
"""Shares of the hover that are tried, the next one where there is no room or no reach for the one before."""

ENDS = 4
"""How many free spots a way may end over."""
LONG_TURN = 2.3
"""Radians of turn from which it matters which way round the hand goes."""


@register("concept")
class Bring(Carry):
    """Carry a held object to a place or a position (keeps free space: NC).

    The object ends ``hover`` above the place (above the rim of a bin), over the place's origin and with its
    heading, up to the object's symmetry; with ``anywhere`` over a free spot of the place, and with ``beside``
    over one next to another object, on what that stands on, whichever the arm can put it on. The way goes
    through ``via`` where it is given and clear; else straight where that is clear of furniture and of other
    objects, for the arm and for what it holds; else it is searched for.

    Args:
        target: The held object.
        to: The place, or another object to bring it above.
        position: Where the object's centre ends, robot base frame; instead of ``to``.
        anywhere: Any free spot on the place will do.
        beside: An object next to which a free spot is to be found; instead of ``to``.
        gap: How far apart the two are then; where there is no room for that, less or more.
        via: Positions of the object's centre on the way, relative to the destination, base-frame axes.
        hover: Free height that remains under the object.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    to: PlaceName | None = None
    position: Position | None = None
    anywhere: Flag = False
    beside: ObjectName | None = None
    gap: Metres = GAP
    via: Points = ()
    hover: Metres = 0.06
    speed: MetresPerSecond = 0.5
    force_limit: Newtons = FORCE_LIMIT

    establishes = (
        ConditionOf("Over", target="target", place="to", anywhere="anywhere"),
        ConditionOf("OverBeside", target="target", other="beside"),
    )
    requires = (ConditionOf("Lifted", target="target"),)
    contact = ContactChange(ContactState.NC, ContactState.NC)
    presentation = Presentation(
        colour="#b07d22",
        spoken=r"bring|carr(?:y|ies)|mov(?:e|ing)|transport|take .* (?:to|over)\b|over to",
        sayings=("I carry the {} over", "bring it to the {}", "now I move it to the {}"),
        says_destination=True,
    )
    default_timeout = 15.0
    default_tolerance = 0.01

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Where to, and over how many via-points."""
        said = [f"to {parameters['to']}"] if "to" in parameters else []
        said += [f"beside {parameters['beside']}"] if "beside" in parameters else []
        if "position" in parameters:
            said.append(f"to {position_words(parameters['position'])}")
        if "via" in parameters:
            count = len(parameters["via"])
            said.append(f"{count} via-point{'' if count == 1 else 's'}" if count else "straight")
        return ", ".join(said)

    @classmethod
    def from_task(cls, task: Task, later: Sequence[Task]) -> dict[str, Any]:
        """Destination and via-points; it ends as high as the place after it began."""
        given = task.parameters
        out: dict[str, Any] = {"target": given["target"]}
        if given.get("to"):
            out["to"] = given["to"]
        else:
            out["position"] = tuple(rounded(v) for v in given["position"])
        out["via"] = rounded_points(given.get("via", ()))
        for other in later:
            if other.concept == "place" and other.parameters["target"] == given["target"]:
                out["hover"] = rounded(np.clip(other.parameters["distance"], *HOVERS))
                break
        return out

    def contradiction(self) -> str:
        """One destination, neither none nor several."""
        if sum(value is not None for value in (self.to, self.position, self.beside)) != 1:
            return "give either 'to', 'position' or 'beside'"
        return "'anywhere' goes with 'to', a place" if self.anywhere and self.to is None else ""

    def begin(self, seen: Seen) -> MoveMemory:
        """Find the way.

        Raises:
            NoWayError: There is none in one of the worlds.
        """
        now = seen.object(self.target)
        found = views(seen)
        chosen = [self._chosen(view) for view in found] if self._chooses else []
        if chosen:
            goal = constant(np.array([ends.options[0] for ends in chosen if ends.options is not None]), now)
            origin = goal[:, :3]
        else:
            goal, origin = self._goal(seen, now)
        grip = poses.relative(now, seen.tool)
        tool_goal = poses.multiply(goal, grip)
        middle, turns = _by_neutral(seen, tool_goal)
        via = self._via(now, goal, origin, grip)
        arrays = [tool_goal, goal[:, 2] - self.hover, middle, turns, *self._exits(seen), *via]
        goals, floors, middles, turned, outs, intos, *vias = host_numbers(arrays)
        put_down = self._put_down(seen)
        ways: list[list[Array]] = []
        routes: dict[int, list[Route]] = {}
        for k, view in enumerate(found):
            if chosen:
                ends = chosen[k]._replace(first=goals[k])
            else:
                supports = supports_of(view, self.to) if self.to is not None else frozenset()
                floor = float(floors[k]) if put_down else None
                later = self._later(seen, k)
                options = self._options(view, later)
                aside = None
                if self.to is not None and options is not None and put_down:
                    aside = aside_options(view, self.to, options, held=True)
                ends = self._low(view, WayEnds(goals[k], options, floor, supports, aside), later)
            turn = middles[k] if bool(turned[k]) else None
            way, route = way_over(
                view,
                self.target,
                ends,
                self.speed,
                ProposedWay([v[k] for v in vias], turn, (outs[k], intos[k])),
            )
            if route is not None:
                routes[k] = [route]
            ways.append(way)
        most = max(len(way) for way in ways)
        padded = np.array([[*way, *[way[-1]] * (most - len(way))] for way in ways])
        points = [constant(padded[:, k], tool_goal) for k in range(most)]
        path = plan(
            points if len(routes) < len(found) else points[:1], self.speed, blend=0.04, samples=SAMPLES
        )
        arm = arm_of(seen.robot)
        usual = joints_along(path, arm, {k: view.arm for k, view in enumerate(found) if k not in routes})
        slow = hurried(usual, arm, Pace(self.speed))
        path = with_routes(path, {**routes, **slow}, len(seen.robot.arm_joints))
        return MoveMemory(in_postures(path, {k: way for k, way in usual.items() if k not in slow}))

    def aim(self, view: WorldView) -> Aim | None:
        """Above its destination."""
        if self._chooses:
            spots = self._spots(view)
            return Aim(_over(spots, self.hover)[spots.few], f"be brought {self._where}", on_the_way=True)
        options = self._options(view)
        if options is None or self.to is None:
            return None
        aside = aside_options(view, self.to, options)
        return Aim(options, f"be brought to {self.to}", on_the_way=True, aside=aside)

    @property
    def _chooses(self) -> bool:
        """It looks for a free spot."""
        return self.anywhere or self.beside is not None

    @property
    def _where(self) -> str:
        return f"beside {self.beside}" if self.beside is not None else f"anywhere onto {self.to}"

    def _spots(self, view: WorldView) -> Spots:
        if self.beside is not None:
            return spots_beside(view, self.target, self.beside, self.gap)
        assert self.to is not None
        return spots_on(view, self.target, self.to)

    def _chosen(self, view: WorldView) -> WayEnds:
        """Free spots over which the way may end, and on which the arm can put the object from there.

        Raises:
            NoWayError: There is none.
        """
        spots = self._spots(view)
        over = np.concatenate([_over(spots, share * self.hover) for share in LOWER])
        tools = poses.multiply(over, poses.relative(view.objects[self.target], view.tool)[None])
        goals = WayEnds(tools[0], None, float(spots.poses[0, 2]), spots.supports)
        ways = [CarriedWay(view, self.target, goals, Pace(self.speed), *closer) for closer in SPOT_ROOMS]
        reached = ways[-1].reached(tools, len(spots.poses))
        for way in ways:
            serving = (k for k, tool in enumerate(tools) if reached(k) and way.serves(tool))
            good = list(itertools.islice(serving, ENDS))
            if good:
                return goals._replace(first=tools[good[0]], options=over[good])
        raise NoWayError(
            f"the arm can put {self.target} down on none of {len(spots.poses)} free spots {self._where}: "
            f"bring things nearer, or make room"
        )

    def _put_down(self, seen: Seen) -> bool:
        """Whether it is going to be put down where it is brought to."""
        after = next((model for model in seen.later if getattr(model, "actor", None) == self.target), None)
        return after is not None and self.to is not None and after.values.get("on") == self.to

    def _options(self, view: WorldView, later: Sequence[str] = ()) -> Array | None:
        """Poses ``(k, 7)`` in which the object may end; None where it may end in one alone.

        Args:
            view: The world.
            later: Objects that may still go there, too.
        """
        if self.to is None:
            return None
        hovers = [share * self.hover for share in LOWER]
        return preferred_options(view, self.target, self.to, hovers, later)

    def _later(self, seen: Seen, row: int) -> list[str]:
        """Objects that the tree may still bring to the same place, in one world."""
        coming = seen.to_come(row)
        found = [getattr(model, "actor", None) for model in coming if model.values.get("to") == self.to]
        return [name for name in dict.fromkeys(found) if name is not None and name != self.target]

    def _low(self, view: WorldView, goals: WayEnds, later: Sequence[str]) -> WayEnds:
        """Low over a container with something in it, or to come: what falls far bounces off that."""
        place = None if self.to is None else view.world.places.get(self.to)
        if goals.options is None or place is None or not place.container:
            return goals
        if not later and not lies_in(view, self.target, place):
            return goals
        grip = poses.relative(view.objects[self.target], view.tool)
        lowest = goals.options[np.argsort(np.round(goals.options[:, 2], 6), kind="stable")]
        return goals._replace(first=poses.multiply(lowest[0], grip), options=lowest)

    def _goal(self, seen: Seen, now: Array) -> tuple[Array, Array]:
        """Poses ``(N, 7)`` of the object at the end, and the destination's origin that ``via`` refers to."""
        xp = array_namespace(now)
        if self.position is not None:
            origin = xp.zeros_like(now[:, :3]) + constant(self.position, now)
            return xp.concat([origin, now[:, 3:]], axis=-1), origin
        assert self.to is not None
        frame, rim = destination(seen, self.to)
        grip = poses.quat_multiply(poses.quat_conjugate(now[:, 3:]), seen.tool[:, 3:])
        neutral = neutral_rotation(seen, poses.z_axis(seen.tool[:, 3:]), frame[:, :3])
        easiest = poses.quat_multiply(neutral, poses.quat_conjugate(grip))
        goal = standing_pose(frame, now, seen.model(self.target), rim + self.hover, easiest)
        return goal, frame[:, :3]

    def _via(self, now: Array, goal: Array, origin: Array, grip: Array) -> list[Array]:
        """Tool poses at the via-points, turned evenly from one to the next."""
        xp, out = array_namespace(now), []
        for k, via in enumerate(self.via):
            share = xp.zeros_like(now[:, 0]) + (k + 1) / (len(self.via) + 1)
            turned = poses.interpolate(now, goal, share)[:, 3:]
            out.append(poses.multiply(xp.concat([origin + constant(via, now), turned], axis=-1), grip))
        return out

    def _exits(self, seen: Seen) -> tuple[Array, Array]:
        """Displacements ``(N, 3)`` that take the tool out of what it starts in, and out of where it ends."""
        xp = array_namespace(seen.tool)
        stands, below = resting_place(seen, self.target), place_below(seen, self.target)
        nothing = xp.zeros_like(seen.tool[:, :3])
        out = xp.where(below.found[:, None], below.place.clearance[:, None] * below.place.exit, nothing)
        out = xp.where(stands.found[:, None], stands.place.clearance[:, None] * stands.place.exit, out)
        if self.to is None or self.to not in seen.world.place_columns:
            return out, nothing
        goal = seen.place(self.to)
        return out, xp.where(goal.container[:, None], nothing, goal.clearance[:, None] * goal.exit)


def _over(spots: Spots, hover: float) -> Array:
    """Poses ``(k, 7)`` so many metres over spots, and over what is around them."""
    found: Array = spots.poses.copy()
    found[:, 2] += spots.rims + hover
    return found


def _by_neutral(seen: Seen, goal: Array) -> tuple[Array, Array]:
    """The poses ``(N, 7)`` half way of the longer turn, and booleans ``(N,)``: it is the one to take.

    Turned by nearly half a turn, the shorter way may be the one that the arm cannot go, since it leads the
    hand round by its hindmost orientation.
    """
    start = seen.tool
    xp = array_namespace(start)
    far = poses.angle_between(start[:, 3:], goal[:, 3:]) >= LONG_TURN
    middle = poses.interpolate(start, goal, 0.5 + xp.zeros_like(start[:, 0]))
    neutral = neutral_rotation(seen, poses.z_axis(middle[:, 3:]), middle[:, :3])
    hindmost = poses.angle_between(neutral, middle[:, 3:]) > math.pi / 2
    turned = poses.quat_multiply(middle[:, 3:], constant([0.0, 0.0, 0.0, 1.0], middle))
    return xp.concat([middle[:, :3], turned], axis=-1), far & hindmost
