"""Hold: press a held object against a stop for a while."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.parameters import Direction, Newtons, ObjectName, PlaceName, Seconds
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.holding import may_hold, not_held
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, force_at_tool
from bt_tasksim.concept_nodes.pressing import Pressing
from bt_tasksim.concept_nodes.stops import gaps, no_way_named, ways_in
from bt_tasksim.concept_nodes.view import views
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Possible
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Command
from bt_tasksim.scene.walls import CLOSE

STEEP = 0.5
"""Upward part of a direction from which on what is pressed that way is not pressed against a wall."""


class HoldMemory(NamedTuple):
    """What is remembered in ``N`` worlds.

    Attributes:
        start: Tool pose ``(N, 7)`` at the begin.
        along: Unit vectors ``(N, 3)`` in which it is pressed.
        pushed: Metres ``(N,)`` that the tool is told to go beyond there.
        pressed: Newtons ``(N,)`` with which it presses, smoothed.
        held: Seconds ``(N,)`` for which that has been between its limits.
    """

    start: Array
    along: Array
    pushed: Array
    pressed: Array
    held: Array


@register("concept")
class Hold(Pressing[HoldMemory]):
    """Press a held object against a stop for a while (keeps contact: FT).

    The force is led to the middle of its limits; the time counts for which it stays between them.

    Args:
        target: The held object.
        direction: Which way it is pressed, robot base frame; by default to the nearest wall of ``against``.
        duration: For how long, without a break.
        least: Force with which it presses at least.
        most: Force with which it presses at most.
        against: The place or the object against which it is pressed.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    direction: Direction | None = None
    duration: Seconds = 2.0
    least: Newtons = 5.0
    most: Newtons = 25.0
    against: PlaceName | None = None
    force_limit: Newtons = FORCE_LIMIT

    establishes = (
        ConditionOf("HeldAgainst", target="target", other="against", sometimes=True),
        ConditionOf("Against", target="target", other="against", sometimes=True),
    )
    contact = ContactChange(ContactState.FT, ContactState.FT)
    presentation = Presentation(
        colour="#6b4f9b",
        spoken=r"hold .* (?:against|there)|press",
        sayings=("hold it there", "I press the {} against it"),
    )

    def contradiction(self) -> str:
        """Limits in their order, and something that says which way."""
        return super().contradiction() or no_way_named(self.direction, self.against, "against")

    def initial_state(self, seen: Seen) -> Possible:
        """The object must be in the hand."""
        return not_held(seen, self.target)

    def begin(self, seen: Seen) -> HoldMemory:
        """Where the tool is, what is felt, and which way it is pressed.

        Raises:
            NoWayError: Nothing says that in one of the worlds.
        """
        nothing = array_namespace(seen.tool).zeros_like(seen.tool[:, :3])
        if self.direction is None:
            ways = ways_in(views(seen), self.target, None, self.against, self.tolerance)
            along = constant(ways, seen.tool)
        else:
            along = constant(np.array(self.direction), seen.tool) + nothing
        felt = _force_against(seen, along)
        return HoldMemory(seen.tool, along, nothing[:, 0], felt, nothing[:, 0])

    def felt(self, seen: Seen, memory: HoldMemory) -> Array:
        """See `Pressing.felt`."""
        return _force_against(seen, memory.along)

    def gone(self, seen: Seen, memory: HoldMemory) -> Array:
        """See `Pressing.gone`."""
        return poses.dot(seen.tool[:, :3] - memory.start[:, :3], memory.along)

    def commanded(self, seen: Seen, after: HoldMemory) -> Command:
        """A little beyond where it began."""
        return Command(tool=poses.shifted(after.start, after.pushed[:, None] * after.along))

    def maintained(self, goal: str, seen: Seen, memory: HoldMemory) -> Array:
        """The object may still be in the hand."""
        return may_hold(seen, self.target)

    def sufficient_cost(self, known: Known, memory: HoldMemory) -> Array:
        """The true gap to the stop, over what counts as touching; 1 at least unless it is between two things.

        What is pressed up or down has no wall beside it: there it has to touch something besides the hand.
        """
        xp, nothing = array_namespace(known.hidden.tool_pose), known.hidden.tool_pose[:, 0] * 0.0
        steep = self.direction is not None and abs(self.direction[2]) > STEEP
        apart = nothing
        if self.against is not None or not steep:
            apart = gaps(known.world, known.hidden.objects, self.target, self.against) / CLOSE
        between = known.supported(self.target) & (known.hand_force(self.target) > 0.0)
        return xp.where(between, apart, xp.maximum(apart, nothing + 1.0))


def _force_against(seen: Seen, along: Array) -> Array:
    """Force ``(N,)`` against directions ``(N, 3)``, N."""
    return -poses.dot(force_at_tool(seen), along)
