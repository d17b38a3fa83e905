"""What pick and bring share: a held object is moved along a planned path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from typing_extensions import TypeVar

from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.holding import HOLDING, may_hold, not_held, tool_distance
from bt_tasksim.concept_nodes.limits import force_at_wrist, strain
from bt_tasksim.concept_nodes.touching import touched
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Possible, Statement
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.units import METRES, NEWTONS
from bt_tasksim.core.world import Command
from bt_tasksim.planning.arm import FULL, arm_of
from bt_tasksim.planning.reference_motion import Path, at_times, plan, searched_for
from bt_tasksim.planning.route import Pace, followed
from bt_tasksim.planning.routes import SAMPLES, hurried, in_postures, with_routes

CARRIED = Form(
    "tool {tool_to_goal} from its goal, {object} {object_to_tool} from the tool, {force} at the wrist{touch}",
    {"tool_to_goal": METRES, "object_to_tool": METRES, "force": NEWTONS},
)
SLIP = 0.03
"""Metres that a carried object may slip in the hand. Source, as of `TILT`: the last stage of the released
original's grasp training, task-sequencing-robotics-simulator."""
TILT = math.radians(10.0)
"""Radians that a carried object may turn in the hand."""


class MoveMemory(NamedTuple):
    """A path that the tool follows."""

    path: Path


class Moved(Protocol):
    """A memory that holds such a path, among other things."""

    @property
    def path(self) -> Path:
        """The path."""


MovedT = TypeVar("MovedT", bound=Moved, default=MoveMemory)


def straight_path(
    seen: Seen, goal: Array, speed: float, joints: Sequence[Array], before: Sequence[Array] = ()
) -> Path:
    """The tool's paths straight to goals ``(N, 7)``, in the postures in which the arm was looked at.

    An arm of few joints turns its tool on the way as far as it must, so its way is that of its joints. Where
    joints would have to hurry, the tool goes as fast as they can.

    Args:
        seen: Where the tool is.
        goal: Where it goes.
        speed: Its peak speed, m/s.
        joints: Joints ``(n, n_arm)`` evenly along the way, in each world; none where it stays where it is.
        before: The same for a way that comes first, if any does: the arm comes to rest after it.
    """
    ways, arm = {k: way for k, way in enumerate(joints) if len(way)}, arm_of(seen.robot)
    path = plan([seen.tool, goal], speed, samples=SAMPLES)
    if len(seen.robot.arm_joints) >= FULL and not len(before):
        slow = hurried(ways, arm, Pace(speed))
        path = with_routes(path, slow, len(seen.robot.arm_joints))
        return in_postures(path, {k: way for k, way in ways.items() if k not in slow})
    pieces = {k: [before[k], way] if len(before) and len(before[k]) else [way] for k, way in ways.items()}
    routes = {k: [followed(arm, piece, Pace(speed)) for piece in found] for k, found in pieces.items()}
    return with_routes(path, routes, len(seen.robot.arm_joints))


class Carry(ConceptModel[MovedT]):
    """A task in which the held ``target`` is moved along a path that `begin` plans, and must stay held."""

    target: str
    force_limit: float

    maintains = (HOLDING,)

    def initial_state(self, seen: Seen) -> Possible:
        """The object must be in the hand."""
        return not_held(seen, self.target)

    def command(self, action: Array, seen: Seen, memory: MovedT) -> Command:
        """Follow the path; the hand keeps its grip."""
        tool, arm = at_times(memory.path, seen.elapsed)
        return Command(tool=tool, posture=arm)

    def planned(self, memory: MovedT) -> Array | float:
        """How long the way takes, where it was searched for."""
        return searched_for(memory.path)

    def limits(self, seen: Seen, memory: MovedT) -> tuple[Limit, ...]:
        """The force at the wrist."""
        return (strain(seen, self.force_limit),)

    def done(self, seen: Seen, memory: MovedT) -> Array:
        """The tool has come to the end of the path."""
        return (seen.elapsed >= memory.path.duration) & (miss(seen, memory.path) < self.tolerance)

    def maintained(self, goal: str, seen: Seen, memory: MovedT) -> Array:
        """The object may still be in the hand."""
        return may_hold(seen, self.target)

    def necessary_cost(self, seen: Seen, memory: MovedT) -> Array:
        """Distance of the tool from the end of the path, metres."""
        return miss(seen, memory.path)

    def sufficient_cost(self, known: Known, memory: MovedT) -> Array:
        """How far the object failed to follow the hand, over what is tolerable.

        10 unless it hangs in the hand, clear of everything else; else the larger of its slip in the hand over
        `SLIP` and of its tilt against the hand over `TILT`, where it is known how it lay there at first.
        """
        free = ~known.supported(self.target) & (known.hand_force(self.target) > 0.2)
        xp = array_namespace(known.hidden.tool_pose)
        nothing = xp.zeros_like(known.hidden.tool_pose[:, 0])
        cost = xp.where(free, nothing, nothing + 10.0)
        if known.began is None:
            return cost
        first = Known(known.began, known.world)
        before, after = (poses.relative(k.hidden.tool_pose, k.object(self.target)) for k in (first, known))
        slip = poses.norm(after[:, :3] - before[:, :3]) / SLIP
        tilt = poses.angle_between(before[:, 3:], after[:, 3:]) / TILT
        return xp.maximum(cost, xp.maximum(slip, tilt))

    def explain(self, seen: Seen, memory: MovedT) -> Statement:
        """How far the tool still is from its goal, and the object from the tool."""
        return CARRIED(
            tool_to_goal=miss(seen, memory.path),
            object=self.target,
            object_to_tool=tool_distance(seen, self.target),
            force=force_at_wrist(seen),
            touch=touched(seen, self.target),
        )


def miss(seen: Seen, path: Path) -> Array:
    """Distance ``(N,)`` in metres of the tool from the end of a path."""
    return poses.norm(seen.tool[:, :3] - path.table[:, -1, :3])
