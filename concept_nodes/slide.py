"""Slide: move a held object along what it is pressed on, as one wipes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.parameters import (
    Direction,
    Metres,
    MetresPerSecond,
    Newtons,
    ObjectName,
    PlaceName,
    Points,
    Position,
)
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.destination import destination
from bt_tasksim.concept_nodes.level_way import goal_words, level, not_level, not_one_goal
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT
from bt_tasksim.concept_nodes.slid import ABOVE, GOOD, Slid
from bt_tasksim.concept_nodes.standing import reference_frame
from bt_tasksim.concept_nodes.tipping import support_of
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.registry import register


@register("concept")
class Slide(Slid):
    """Slide a held object along what it is pressed on (keeps contact: TR).

    It comes down until the wrist feels what is below, goes along it through ``via`` to its goal, and presses
    all the way. Its height is that at which it presses, so what it slides on need not be quite level.

    Args:
        target: The held object.
        to: The place over whose origin its middle goes.
        position: Where its middle goes, robot base frame; the height is of no account.
        direction: Which way it goes, robot base frame, level.
        distance: How far it goes in ``direction``.
        via: Positions of its middle on the way, relative to where that ends, base-frame axes.
        press: Force with which it presses.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    to: PlaceName | None = None
    position: Position | None = None
    direction: Direction | None = None
    distance: Metres | None = None
    via: Points = ()
    press: Newtons = 5.0
    speed: MetresPerSecond = 0.12
    force_limit: Newtons = FORCE_LIMIT

    establishes = (ConditionOf("PressedOn", target="target", place="to"),)
    contact = ContactChange(ContactState.TR, ContactState.TR)
    presentation = Presentation(
        colour="#7a8f3a",
        spoken=r"wip|slid(?:e|ing)|sweep|rub",
        sayings=("I wipe along here", "slide the {} along", "and wipe the table"),
    )

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Where to."""
        return ", ".join(goal_words(parameters))

    def contradiction(self) -> str:
        """One goal, and a way that is level."""
        goals = not_one_goal(self.to, self.position, self.direction, self.distance)
        return goals or not_level(self.direction)

    def waypoints(self, seen: Seen, each: Sequence[WorldView]) -> Sequence[Array]:
        """See `Slid.waypoints`."""
        xp, now = array_namespace(seen.tool), seen.object(self.target)[:, :3]
        if self.to is not None:
            end = destination(seen, self.to)[0][:, :3] - now
        elif self.position is not None:
            end = constant(self.position, now) - now
        else:
            assert self.direction is not None and self.distance is not None
            end = level(self.direction, self.distance, now) + xp.zeros_like(now)
        points = [*(end + constant(via, now) for via in self.via), end]
        return [xp.concat([point[:, :2], xp.zeros_like(point[:, 2:])], axis=-1) for point in points]

    def missed(self, known: Known) -> Array:
        """How far its middle truly is from its goal, seen from above; 0 where nobody knows where it was."""
        now = known.object(self.target)[:, :3]
        if self.to is not None:
            there = self.to in known.world.place_columns
            goal = (known.place(self.to).pose if there else known.object(self.to))[:, :3]
        elif self.position is not None:
            goal = 0.0 * now + constant(self.position, now)
        elif known.began is None:
            goal = now
        else:
            assert self.direction is not None and self.distance is not None
            before = Known(known.began, known.world).object(self.target)[:, :3]
            goal = before + level(self.direction, self.distance, now)
        return poses.norm((now - goal)[:, :2]) / GOOD

    def aim(self, view: WorldView) -> Aim | None:
        """To where it ends, where that is said."""
        if self.to is None and self.position is None:
            return None
        now = view.objects[self.target]
        end = reference_frame(view, self.to)[0] if self.to is not None else np.array(self.position)
        there = np.concatenate([end[:2], now[2:3] + ABOVE, now[3:]])
        supports = frozenset(support_of(view, self.target)[0])
        return Aim(there[None], "be slid there", supports, on_the_way=True)
