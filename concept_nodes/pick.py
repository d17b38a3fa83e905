"""Pick: take a held object off its support."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.demonstrated import rounded, snapped, straight_words
from bt_tasksim.concept.parameters import Direction, Metres, MetresPerSecond, Newtons, ObjectName
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes.carry import Carry, MoveMemory
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register
from bt_tasksim.planning.reference_motion import plan


@register("concept")
class Pick(Carry):
    """Take a held object off what it rests on (breaks its contact: PC to NC).

    Args:
        target: The held object.
        direction: Direction away from the support, robot base frame.
        distance: How far.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
        squeeze: Largest sum of the hand's forces on the object, at the beginning and at the end, with which
            the goal counts as reached; None: it may be squeezed as hard as one likes.
    """

    target: ObjectName
    direction: Direction = (0.0, 0.0, 1.0)
    distance: Metres = 0.10
    speed: MetresPerSecond = 0.3
    force_limit: Newtons = FORCE_LIMIT
    squeeze: Newtons | None = None

    contact = ContactChange(ContactState.PC, ContactState.NC)
    presentation = Presentation(
        colour="#2f8f6b",
        spoken=r"pick|lift|rais|take .* up\b|take .* off\b",
        sayings=("I lift the {}", "pick it up", "raise the {} a bit"),
    )
    default_timeout = 8.0

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """How far it goes which way, and off what."""
        said = [straight_words(parameters)] if "distance" in parameters else []
        return ", ".join([*said, *([f"off {parameters['off']}"] if "off" in parameters else [])])

    @classmethod
    def from_task(cls, task: Task, later: Sequence[Task]) -> dict[str, Any]:
        """Direction and distance."""
        given = task.parameters
        return {
            "target": given["target"],
            "direction": snapped(given["direction"]) or (0.0, 0.0, 1.0),
            "distance": rounded(given["distance"]),
        }

    def begin(self, seen: Seen) -> MoveMemory:
        """A straight path."""
        goal = poses.shifted(seen.tool, self.distance * poses.constant(self.direction, seen.tool))
        return MoveMemory(plan([seen.tool, goal], self.speed, samples=2))

    def sufficient_cost(self, known: Known, memory: MoveMemory) -> Array:
        """As in `Carry`; or the hand's force on the object over ``squeeze``, where that is larger."""
        cost = super().sufficient_cost(known, memory)
        if self.squeeze is None:
            return cost
        xp = array_namespace(cost)
        cost = xp.maximum(cost, known.hand_force(self.target) / self.squeeze)
        if known.began is None:
            return cost
        first = Known(known.began, known.world)
        return xp.maximum(cost, first.hand_force(self.target) / self.squeeze)
