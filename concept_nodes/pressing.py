"""The law of tasks that press what the hand holds against a stop for a while."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, Self, TypeVar

from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Newtons, ObjectName, Seconds
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.holding import HOLDING
from bt_tasksim.concept_nodes.limits import longer_than_allowed, strain
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.units import METRES, NEWTONS, SECONDS
from bt_tasksim.core.world import Command

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


class PressingMemory(Protocol):
    """What such a task remembers in ``N`` worlds, among other things."""

    @property
    def pushed(self) -> Array:
        """Metres ``(N,)`` that the tool is told to go beyond where it began."""

    @property
    def pressed(self) -> Array:
        """Newtons ``(N,)`` with which it presses, smoothed."""

    @property
    def held(self) -> Array:
        """Seconds ``(N,)`` for which that has been between its limits."""

    def _replace(self, *, pushed: Array, pressed: Array, held: Array) -> Self: ...


PressingT = TypeVar("PressingT", bound=PressingMemory)


class Pressing(ConceptModel[PressingT]):
    """A task that leads the force at the hand to between two limits, and counts the time for which it is."""

    target: ObjectName
    duration: Seconds
    least: Newtons
    most: Newtons
    force_limit: Newtons

    maintains = (HOLDING,)
    default_timeout = 15.0
    default_tolerance = 0.03

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """For how long."""
        return f"for {float(parameters['duration']):.1f} s" if "duration" in parameters else ""

    def contradiction(self) -> str:
        """Limits in their order, and time for what is asked."""
        wrong = "" if self.least < self.most else "'least' should be less than 'most'"
        return wrong or ("" if self.patient else longer_than_allowed(self.duration, self.timeout))

    def planned(self, memory: PressingT) -> Array | float:
        """The time for which it presses comes on top of the usual timeout."""
        return self.duration

    def felt(self, seen: Seen, memory: PressingT) -> Array:
        """Force ``(N,)`` with which it presses, N."""
        raise NotImplementedError

    def gone(self, seen: Seen, memory: PressingT) -> Array:
        """Metres ``(N,)`` that the hand has gone beyond where it began."""
        raise NotImplementedError

    def commanded(self, seen: Seen, after: PressingT) -> Command:
        """What is asked of the robot once a step is made."""
        raise NotImplementedError

    def led_to(self, seen: Seen, memory: PressingT) -> tuple[Array | float, Array | bool]:
        """Force to which it is led, N, the middle of its limits; and whether it is where pressing counts."""
        return (self.least + self.most) / 2, True

    def command(self, action: Array, seen: Seen, memory: PressingT) -> Command:
        """A little beyond where it began."""
        return self.commanded(seen, self.advance(action, seen, memory))

    def carry_out(self, action: Array, seen: Seen, memory: PressingT) -> tuple[Command, PressingT]:
        """Both, of one step."""
        after = self.advance(action, seen, memory)
        return self.commanded(seen, after), after

    def advance(self, action: Array, seen: Seen, memory: PressingT) -> PressingT:
        """Lead the force to what is wanted, and count the time."""
        xp, period = array_namespace(seen.tool), seen.world.control_period
        pressed = memory.pressed + SMOOTH * (self.felt(seen, memory) - memory.pressed)
        wanted, counts = self.led_to(seen, memory)
        speed = poses.clip(YIELDS * (wanted - pressed), -QUICKEST, QUICKEST)
        within = (pressed >= self.least) & (pressed <= self.most) & counts
        held = xp.where(within, memory.held + period, xp.zeros_like(memory.held))
        return memory._replace(pushed=memory.pushed + period * speed, pressed=pressed, held=held)

    def done(self, seen: Seen, memory: PressingT) -> Array:
        """It has been pressed for long enough."""
        return memory.held >= self.duration

    def limits(self, seen: Seen, memory: PressingT) -> tuple[Limit, ...]:
        """The force at the wrist; and there is a stop."""
        gone = self.gone(seen, memory)
        return strain(seen, self.force_limit), Limit(GIVES_WAY, gone, self.tolerance, {"object": self.target})

    def necessary_cost(self, seen: Seen, memory: PressingT) -> Array:
        """Seconds that are left."""
        return poses.clip(self.duration - memory.held, 0.0, self.duration)

    def explain(self, seen: Seen, memory: PressingT) -> Statement:
        """What is felt, and for how long it has been so."""
        return PRESSED(object=self.target, force=memory.pressed, held=memory.held, duration=self.duration)
