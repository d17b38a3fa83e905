"""Pick: take a held object off its support."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bt_tasksim import poses
from bt_tasksim.concept import ConceptModel
from bt_tasksim.context import Known, Seen
from bt_tasksim.motion import Path, plan, sample
from bt_tasksim.parameters import Direction, Metres, MetresPerSecond, Newtons, ObjectName
from bt_tasksim.poses import Array, array_namespace
from bt_tasksim.world import Command
from concept_nodes.holding import HOLDING, holding, not_held, tool_distance
from concept_nodes.limits import FORCE_LIMIT, force_at_wrist, strained


class MoveMemory(NamedTuple):
    """A path that the tool follows."""

    path: Path


class Pick(ConceptModel):
    """Take a held object off what it rests on (breaks its contact: PC to NC).

    Args:
        target: The held object.
        direction: Direction away from the support, robot base frame.
        distance: How far.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    direction: Direction = (0.0, 0.0, 1.0)
    distance: Metres = 0.10
    speed: MetresPerSecond = 0.3
    force_limit: Newtons = FORCE_LIMIT

    maintains = (HOLDING,)
    default_timeout = 8.0

    def initial_state(self, seen: Seen) -> str:
        """The object must be in the hand."""
        if not bool(holding(seen, self.target)):
            return not_held(seen, self.target)
        return ""

    def begin(self, seen: Seen) -> MoveMemory:
        """A straight path."""
        goal = seen.tool.copy()
        goal[:3] += self.distance * np.asarray(self.direction)
        return MoveMemory(plan([seen.tool, goal], self.speed, samples=2))

    def command(self, action: Array, seen: Seen, memory: MoveMemory) -> Command:
        """Follow the path; the hand keeps its grip."""
        return Command(tool=sample(memory.path, seen.elapsed))

    def violated(self, seen: Seen, memory: MoveMemory) -> Array:
        """The wrist is strained beyond the limit: the hand or the object presses against something."""
        return strained(seen, self.force_limit)

    def done(self, seen: Seen, memory: MoveMemory) -> Array:
        """The tool has come to the end of the path."""
        return arrived(seen, memory.path, self.tolerance)

    def maintained(self, goal: str, seen: Seen, memory: MoveMemory) -> Array:
        """The object is still in the hand."""
        return holding(seen, self.target)

    def necessary_cost(self, seen: Seen, memory: MoveMemory) -> Array:
        """Distance of the tool from the end of the path, metres."""
        return miss(seen, memory.path)

    def sufficient_cost(self, known: Known, memory: MoveMemory) -> Array:
        """1 unless the object hangs in the hand, clear of everything else."""
        free = ~known.supported(self.target) & (known.hand_force(self.target) > 0.2)
        xp = array_namespace(known.hidden.objects)
        return xp.where(xp.asarray(free), 0.0, 1.0)

    def explain(self, seen: Seen, memory: MoveMemory) -> str:
        """How far the tool still is from its goal, and the object from the tool."""
        return (
            f"tool {1000 * float(miss(seen, memory.path)):.0f} mm from its goal, "
            f"{self.target} {1000 * float(tool_distance(seen, self.target)):.0f} mm from the tool, "
            f"{float(force_at_wrist(seen)):.0f} N at the wrist"
        )


def miss(seen: Seen, path: Path) -> Array:
    """Distance ``(...)`` in metres of the tool from the end of a path."""
    gap = seen.tool[..., :3] - path.table[..., -1, :3]
    return poses.norm(gap)


def arrived(seen: Seen, path: Path, tolerance: float) -> Array:
    """Boolean ``(...)``: the path's time is over and the tool is within ``tolerance`` metres of its end."""
    return (seen.elapsed >= path.duration) & (miss(seen, path) < tolerance)
