"""Extract: pull a held peg out of its hole, or a book out of its row, straight and yielding to the walls."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Metres, MetresPerSecond, Newtons, ObjectName, PlaceName
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes.closer import TOUCHING
from bt_tasksim.concept_nodes.holding import HOLDING, may_hold, not_held
from bt_tasksim.concept_nodes.insertion import hole_of
from bt_tasksim.concept_nodes.insertion_way import ROWS, joints_line, yielding
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, force_at_tool, force_at_wrist, strain
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.outcomes import Form, Possible, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, NEWTONS
from bt_tasksim.core.world import FURNITURE, Command
from bt_tasksim.planning.reference_motion import Path, at_times
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.planning.things import Leave

PULLED = Form(
    "{object} is {missing} from where it is clear of {place}, {force} at the wrist",
    {"missing": METRES, "force": NEWTONS},
)
STUCK_IN = register_reason(
    "stuck_in",
    "{object} stays in {place}: the hand has gone {value} farther than it, more than {limit}",
    value=METRES,
    limit=METRES,
)
SEEN = 0.005
"""Metres before the mouth, beyond the tolerance, from which on a thing is seen to be out."""
LEFT = 0.02
"""Metres by which the hand may go farther than what it pulls."""
STEP = 0.001
"""Metres that it goes aside in a control period at most."""
SOFTLY = 0.4
"""Seconds in which it comes to its speed."""


class ExtractMemory(NamedTuple):
    """What an extraction remembers in ``N`` worlds.

    Attributes:
        line: The arm's joints along the way, evenly.
        tool: Tool poses ``(N, 7)`` at the begin.
        start: Estimated poses ``(N, 7)`` of the object at the begin.
        outward: Unit vectors ``(N, 3)`` out of the hole.
        full: Metres ``(N,)`` that it has to go.
        way: Metres ``(N,)`` that the tool is told to have gone.
        offset: Metres ``(N, 3)`` aside of that.
    """

    line: Path
    tool: Array
    start: Array
    outward: Array
    full: Array
    way: Array
    offset: Array


@register("concept")
class Extract(ConceptModel[ExtractMemory]):
    """Pull a held object straight out of a hole (breaks contact: OP to NC).

    It goes along the hole's own line, slower the more resists, and yields to what presses from aside, until
    it is clear of the mouth.

    Args:
        target: The held object.
        out_of: The hole: a place of this kind.
        clear: How far before the mouth it ends.
        pull: Force with which it is pulled at most.
        speed: Speed where nothing resists.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    out_of: PlaceName
    clear: Metres = 0.03
    pull: Newtons = 30.0
    speed: MetresPerSecond = 0.1
    force_limit: Newtons = FORCE_LIMIT

    maintains = (HOLDING,)
    establishes = (ConditionOf("OutOf", target="target", hole="out_of"),)
    contact = ContactChange(ContactState.OP, ContactState.NC)
    presentation = Presentation(
        colour="#5b8c5a",
        spoken=r"extract|pull .* out\b|draw .* out\b|unplug|take .* out of",
        sayings=("I pull it out of the {}", "extract it from the {}", "it comes out of the {}"),
        says_destination=True,
    )
    default_timeout = 20.0
    default_tolerance = 0.005

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Out of what."""
        return f"out of {parameters['out_of']}" if "out_of" in parameters else ""

    @classmethod
    def from_task(cls, task: Task, later: Sequence[Task]) -> dict[str, Any]:
        """What comes out of what."""
        return {"target": task.parameters["target"], "out_of": task.parameters["out_of"]}

    def contradiction(self) -> str:
        """What ends so near the mouth is never seen to be out."""
        least = round(self.tolerance + SEEN, 6)
        return f"'clear' should be at least {least} m, found {self.clear}" if self.clear < least else ""

    def initial_state(self, seen: Seen) -> Possible:
        """The object must be in the hand."""
        return not_held(seen, self.target)

    def begin(self, seen: Seen) -> ExtractMemory:
        """The line out of the hole.

        Raises:
            NoWayError: In one of the worlds the arm cannot follow it, or it is not clear.
        """
        found, like = [self._found(view) for view in views(seen)], seen.tool
        xp = array_namespace(like)
        full = constant(np.array([way for way, _, _ in found]), like)
        outward = constant(np.array([out for _, out, _ in found]), like)
        nothing = xp.zeros_like(full)
        line = joints_line(constant(np.array([joints for _, _, joints in found]), like), like)
        now = seen.object(self.target)
        return ExtractMemory(line, like, now, outward, full, nothing, xp.zeros_like(outward))

    def _found(self, view: WorldView) -> tuple[float, Array, Array]:
        """How far it has to go, the way ``(3,)``, and the arm's joints ``(n, n_arm)`` along it."""
        hole = hole_of(view, self.out_of)
        out, full = poses.z_axis(np.asarray(hole.pose)[3:]), self._depth(view) + self.clear
        leave = Leave(held={hole.fixture or FURNITURE})
        finder = view.finder([self.target], held=view.held(self.target), leave=leave, closer=TOUCHING)
        line = np.repeat(view.tool[None], ROWS, axis=0)
        line[:, :3] += np.linspace(0.0, full, ROWS)[:, None] * out
        joints = finder.arm.along(finder.start, line[1:])
        if joints is None or not finder.clear(np.concatenate([finder.start[None], joints])):
            touches = finder.touched(line[-1])
            why = f"{touches[0][0]} would touch {touches[0][1]}" if touches else "the arm cannot follow"
            raise NoWayError(f"{self.target} cannot be pulled out of {self.out_of}: {why}")
        return full, out, np.concatenate([finder.start[None], joints])

    def _depth(self, view: WorldView) -> float:
        """How deep the object seems to be below the mouth, metres."""
        hole = hole_of(view, self.out_of)
        corners = poses.transform(
            view.objects[self.target], np.concatenate(pieces_of(view.model(self.target)))
        )
        return max(0.0, hole.height - float(poses.localise(np.asarray(hole.pose), corners)[:, 2].min()))

    def aim(self, view: WorldView) -> Aim | None:
        """Before the mouth."""
        try:
            hole, full = hole_of(view, self.out_of), self._depth(view) + self.clear
        except NoWayError:
            return None  # it is said when it begins
        out = full * poses.z_axis(np.asarray(hole.pose)[3:])
        free = poses.shifted(view.objects[self.target], out)[None]
        return Aim(free, f"be pulled out of {self.out_of}", on_the_way=True)

    def command(self, action: Array, seen: Seen, memory: ExtractMemory) -> Command:
        """Along the line, aside of it where it yields; the hand keeps its grip."""
        _, arm = at_times(memory.line, poses.clip(memory.way / memory.full, 0.0, 1.0))
        moved = memory.way[:, None] * memory.outward + memory.offset
        return Command(tool=poses.shifted(memory.tool, moved), posture=arm)

    def advance(self, action: Array, seen: Seen, memory: ExtractMemory) -> ExtractMemory:
        """Come on as the wrist allows, and yield to what presses from aside."""
        xp, period = array_namespace(seen.tool), seen.world.control_period
        force = force_at_tool(seen)
        along = poses.dot(force, memory.outward)
        speed = self.speed * poses.clip(seen.elapsed / SOFTLY, 0.0, 1.0)
        near = poses.clip((memory.full - memory.way) / (SOFTLY * self.speed), 0.1, 1.0)
        rate = speed * near * poses.clip(1.0 + along / self.pull, -1.0, 1.0)
        inside = (self._come(seen, memory) < memory.full - self.clear)[:, None]
        nowhere = xp.zeros_like(memory.offset)
        offset = yielding(memory.offset, force, memory.outward, nowhere, period, STEP)
        return memory._replace(
            way=poses.clip(xp.minimum(memory.way + period * rate, memory.full), 0.0, math.inf),
            offset=xp.where(inside, offset, memory.offset),
        )

    def _come(self, seen: Seen, memory: ExtractMemory) -> Array:
        """Metres ``(N,)`` that the object was seen to have come."""
        return poses.dot(seen.object(self.target)[:, :3] - memory.start[:, :3], memory.outward)

    def limits(self, seen: Seen, memory: ExtractMemory) -> tuple[Limit, ...]:
        """The force at the wrist; and what is pulled comes along."""
        behind = poses.dot(seen.tool[:, :3] - memory.tool[:, :3], memory.outward) - self._come(seen, memory)
        names = {"object": self.target, "place": self.out_of}
        return strain(seen, self.force_limit), Limit(STUCK_IN, behind, LEFT, names)

    def done(self, seen: Seen, memory: ExtractMemory) -> Array:
        """It is clear of the mouth, and the tool has come to rest there."""
        there = memory.way >= memory.full - 1e-6
        return there & (memory.full - self._come(seen, memory) <= self.clear - self.tolerance)

    def maintained(self, goal: str, seen: Seen, memory: ExtractMemory) -> Array:
        """The object may still be in the hand."""
        return may_hold(seen, self.target)

    def necessary_cost(self, seen: Seen, memory: ExtractMemory) -> Array:
        """Metres that are missing."""
        return abs(memory.full - self._come(seen, memory))

    def sufficient_cost(self, known: Known, memory: ExtractMemory) -> Array:
        """10 unless it hangs in the hand, clear of everything else."""
        free = ~known.supported(self.target) & (known.hand_force(self.target) > 0.2)
        xp, nothing = array_namespace(known.hidden.tool_pose), known.hidden.tool_pose[:, 0] * 0.0
        return xp.where(free, nothing, nothing + 10.0)

    def explain(self, seen: Seen, memory: ExtractMemory) -> Statement:
        """What is missing, and the force."""
        return PULLED(
            object=self.target,
            place=self.out_of,
            missing=memory.full - self._come(seen, memory),
            force=force_at_wrist(seen),
        )
