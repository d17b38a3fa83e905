"""Hold: press a held object against a stop for a while."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Direction, Newtons, ObjectName, PlaceName, Seconds
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.holding import HOLDING, may_hold, not_held
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, force_at_tool, strain
from bt_tasksim.concept_nodes.stops import gaps, no_way_named, ways_in
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Possible, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, NEWTONS, SECONDS
from bt_tasksim.core.world import Command
from bt_tasksim.scene.walls import CLOSE

PRESSED = Form(
    "{object} is pressed with {force:.1f}, {held:.1f} of {duration:.1f} held",
    {"force": NEWTONS, "held": SECONDS, "duration": SECONDS},
)
GIVES_WAY = register_reason(
    "gives_way",
    "{object} has gone {value} before it was pressed against anything, more than {limit}",
    value=METRES,
    limit=METRES,
)
YIELDS, QUICKEST, SMOOTH = 0.0008, 0.01, 0.3
"""Metres per second for each newton that is missing, at most so many; and the share of each reading of the
force in the smoothed one."""
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
class Hold(ConceptModel[HoldMemory]):
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

    maintains = (HOLDING,)
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
    default_timeout = 15.0
    default_tolerance = 0.03

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """For how long."""
        return f"for {float(parameters['duration']):.1f} s" if "duration" in parameters else ""

    def contradiction(self) -> str:
        """Limits in their order, and something that says which way."""
        if self.least >= self.most:
            return "'least' should be less than 'most'"
        return no_way_named(self.direction, self.against, "against")

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
            along = ways_in(seen, self.target, None, self.against, self.tolerance)
        else:
            along = constant(np.array(self.direction), seen.tool) + nothing
        felt = _force_against(seen, along)
        return HoldMemory(seen.tool, along, nothing[:, 0], felt, nothing[:, 0])

    def command(self, action: Array, seen: Seen, memory: HoldMemory) -> Command:
        """A little beyond where it began."""
        return self._commanded(memory, self.advance(action, seen, memory))

    def carry_out(self, action: Array, seen: Seen, memory: HoldMemory) -> tuple[Command, HoldMemory]:
        """Both, of one step."""
        after = self.advance(action, seen, memory)
        return self._commanded(memory, after), after

    def _commanded(self, memory: HoldMemory, after: HoldMemory) -> Command:
        return Command(tool=poses.shifted(memory.start, after.pushed[:, None] * memory.along))

    def advance(self, action: Array, seen: Seen, memory: HoldMemory) -> HoldMemory:
        """Lead the force to the middle of its limits, and count the time."""
        xp, period = array_namespace(seen.tool), seen.world.control_period
        pressed = memory.pressed + SMOOTH * (_force_against(seen, memory.along) - memory.pressed)
        middle = (self.least + self.most) / 2
        speed = poses.clip(YIELDS * (middle - pressed), -QUICKEST, QUICKEST)
        within = (pressed >= self.least) & (pressed <= self.most)
        held = xp.where(within, memory.held + period, xp.zeros_like(memory.held))
        return memory._replace(pushed=memory.pushed + period * speed, pressed=pressed, held=held)

    def done(self, seen: Seen, memory: HoldMemory) -> Array:
        """It has been pressed for long enough."""
        return memory.held >= self.duration

    def limits(self, seen: Seen, memory: HoldMemory) -> tuple[Limit, ...]:
        """The force at the wrist; and there is a stop."""
        gone = poses.dot(seen.tool[:, :3] - memory.start[:, :3], memory.along)
        return strain(seen, self.force_limit), Limit(GIVES_WAY, gone, self.tolerance, {"object": self.target})

    def maintained(self, goal: str, seen: Seen, memory: HoldMemory) -> Array:
        """The object may still be in the hand."""
        return may_hold(seen, self.target)

    def necessary_cost(self, seen: Seen, memory: HoldMemory) -> Array:
        """Seconds that are left."""
        return poses.clip(self.duration - memory.held, 0.0, self.duration)

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

    def explain(self, seen: Seen, memory: HoldMemory) -> Statement:
        """What is felt, and for how long it has been so."""
        return PRESSED(object=self.target, force=memory.pressed, held=memory.held, duration=self.duration)


def _force_against(seen: Seen, along: Array) -> Array:
    """Force ``(N,)`` against directions ``(N, 3)``, N."""
    return -poses.dot(force_at_tool(seen), along)
