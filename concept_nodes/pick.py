"""Pick: take a held object off its support."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.demonstrated import rounded, snapped, straight_words
from bt_tasksim.concept.parameters import Direction, Metres, MetresPerSecond, Newtons, ObjectName
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes.carry import Carry, MoveMemory, straight_path
from bt_tasksim.concept_nodes.closer import CLOSER, TOUCHING, VERY_CLOSE
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register

ROOMS = (CLOSER, VERY_CLOSE, TOUCHING)
"""How much closer than usual one may come to things, tried one after the other."""
SHARES = (1.0, 0.7, 0.5, 0.3, 0.2)
"""Shares of the distance that are tried where not all of it is clear."""
SLANTS = (0.0, 0.5, 1.0)
"""How far it goes towards the robot on the way, in metres for each metre away from the support, tried one
after the other: at the end of its reach an arm cannot go straight up, and from under a board nothing can."""


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

    establishes = (ConditionOf("Lifted", target="target", height="distance"),)
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
        """A straight path, as far as it is clear.

        Raises:
            NoWayError: Something is in the way at once in one of the worlds.
        """
        found = [self._clear(view) for view in views(seen)]
        goal = poses.shifted(seen.tool, constant(np.array([away for away, _ in found]), seen.tool))
        return MoveMemory(straight_path(seen, goal, self.speed, [joints for _, joints in found]))

    def aim(self, view: WorldView) -> Aim | None:
        """Above where it stands, as far as it is lifted, or as far as will do."""
        now = view.objects[self.target]
        up = np.array(self.direction)
        lifted = np.array([poses.shifted(now, share * self.distance * up) for share in (1.0, 0.5, 0.2)])
        return Aim(lifted, "be lifted", on_the_way=True)

    def _clear(self, view: WorldView) -> tuple[Array, Array]:
        """How far the way is clear, ``(3,)`` in metres, and the joints ``(n, n_arm)`` along it."""
        for closer in ROOMS:
            finder = view.finder([self.target], held=view.held(self.target), closer=closer)
            for direction, share in itertools.product(self._ways(view), SHARES):
                away = share * self.distance * direction
                end = poses.shifted(view.tool, away)
                joints = finder.straight([view.tool, end], leans=finder.leanings[-1])
                if joints is not None:
                    return away, np.concatenate([finder.start[None], joints])
        least = poses.shifted(view.tool, SHARES[-1] * self.distance * np.array(self.direction))
        touches = finder.touched(least)
        why = f"{touches[0][0]} would touch {touches[0][1]}" if touches else "the arm cannot follow"
        raise NoWayError(
            f"{self.target} cannot be lifted by {1000 * SHARES[-1] * self.distance:.0f} mm: {why}"
        )

    def _ways(self, view: WorldView) -> list[Array]:
        """Directions ``(3,)`` with a part of one metre a metre away from the support, see `SLANTS`."""
        away = np.array(self.direction)
        back = -view.tool[:3] * np.array([1.0, 1.0, 0.0])
        back = back - float(back @ away) * away
        return [away + slant * back / max(float(np.linalg.norm(back)), 1e-9) for slant in SLANTS]

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
