"""HoldTurned: press a lever, a door or a knob against the stop of its hinge for a while."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.parameters import Newtons, ObjectName, Seconds
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.handle import NO_PART, OTHER_PART, about_handle, at_handle
from bt_tasksim.concept_nodes.holding import NOT_HELD, off_handle
from bt_tasksim.concept_nodes.joint_conditions import value_of
from bt_tasksim.concept_nodes.joint_force import distance_of, force_against, reach_of
from bt_tasksim.concept_nodes.joint_values import nearer_stop
from bt_tasksim.concept_nodes.limits import PART_FORCE_LIMIT
from bt_tasksim.concept_nodes.pressing import Pressing
from bt_tasksim.core import poses
from bt_tasksim.core.joints import LEAST_REACH
from bt_tasksim.core.outcomes import Possible, register_reason
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import RADIANS
from bt_tasksim.core.world import Command

AT_STOP = math.radians(4.0)
"""Radians from a stop within which a part may seem to be where it stands at it."""
BACK, OFF = 0.001, 0.004
"""Metres that the hand may go back from the stop, which an arm does that is soft, before it presses more; and
metres from which on that does not count as held."""
PRESSES_ON, MOSTLY = 2000.0, 0.9
"""Newtons more for each metre beyond, up to that share of ``most``: a spring may be as strong as the middle
of the limits, and would turn the part off its stop."""
FIRST = 1.0
"""Seconds for which it is pressed with that share at first, and which do not count: a part that seems to be
at its stop may stand a little before it, and what is felt may be its spring."""
NO_STOP = register_reason(
    "not_at_stop",
    "{object} stands {value} from the nearer stop of its hinge, more than {limit}: turn it there",
    value=RADIANS,
    limit=RADIANS,
)


class HoldTurnedMemory(NamedTuple):
    """What is remembered in ``N`` worlds.

    Attributes:
        value: Radians ``(N,)`` to which the part was turned at the begin.
        way: Sign ``(N,)`` of the turn onto the stop.
        grip: Pose ``(N, 7)`` of the part in the tool frame.
        reach: Metres ``(N,)`` that the tool goes for each radian, see `joint_force.reach_of`.
        pushed: Metres ``(N,)`` that the tool is told to go beyond the stop.
        pressed: Newtons ``(N,)`` with which it presses, smoothed.
        held: Seconds ``(N,)`` for which that has been between its limits.
        farthest: Metres ``(N,)`` that the hand had gone at most.
    """

    value: Array
    way: Array
    grip: Array
    reach: Array
    pushed: Array
    pressed: Array
    held: Array
    farthest: Array


@register("concept")
class HoldTurned(Pressing[HoldTurnedMemory]):
    """Press a lever, or anything on a hinge, against the stop at which it stands (keeps FT, rotation).

    The force is that of the torque about the hinge, at the hand; near the axis, as on a knob, at 50 mm from
    it. It is led to the middle of its limits, or to more where a spring turns the part back, and the time
    counts for which it stays between them, and the part on its stop.

    Args:
        target: What turns; the hand holds it, and it stands at one of its stops.
        duration: For how long, without a break.
        least: Force with which the hand presses at least.
        most: Force with which it presses at most.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    duration: Seconds = 2.0
    least: Newtons = 4.0
    most: Newtons = 20.0
    force_limit: Newtons = PART_FORCE_LIMIT

    contact = ContactChange(ContactState.FT, ContactState.FT, "rotation")
    presentation = Presentation(
        colour="#57489b",
        spoken=r"(?:keep|hold) .* (?:turned|down|shut)",
        sayings=("keep the {} turned", "I hold the {} down"),
    )

    def initial_state(self, seen: Seen) -> tuple[Possible, ...]:
        """It must be on a hinge, in the hand, and at a stop."""
        model, away = seen.model(self.target), off_handle(seen, self.target)
        now = value_of(seen, self.target)
        off = abs(nearer_stop(now, model.joints.limits)[0] - now)
        turns = model.jointed & model.joint_turns
        return (
            NO_PART.where(~model.jointed, object=self.target),
            OTHER_PART[True].where(model.jointed & ~model.joint_turns, object=self.target),
            NOT_HELD.where(~at_handle(seen, self.target), object=self.target, distance=away),
            NO_STOP.where(turns & (off > AT_STOP), object=self.target, value=off, limit=AT_STOP),
        )

    def begin(self, seen: Seen) -> HoldTurnedMemory:
        """Where the hand is about the hinge, and what is felt."""
        value = value_of(seen, self.target)
        _, way = nearer_stop(value, seen.model(self.target).joints.limits)
        nothing = array_namespace(value).zeros_like(value)
        grip = poses.relative(seen.tool, seen.object(self.target))
        start = HoldTurnedMemory(value, way, grip, *(nothing,) * 5)
        felt = force_against(seen, self.target, way)
        return start._replace(reach=reach_of(seen, self.target), pressed=felt)

    def felt(self, seen: Seen, memory: HoldTurnedMemory) -> Array:
        """See `Pressing.felt`."""
        return force_against(seen, self.target, memory.way)

    def gone(self, seen: Seen, memory: HoldTurnedMemory) -> Array:
        """See `Pressing.gone`: along its way, or, on the axis, where it has none, by what it has turned."""
        law, xp = seen.model(self.target).joints, array_namespace(memory.way)
        free = law._replace(limits=law.limits + poses.constant(np.array([-math.pi, math.pi]), law.limits))
        turned = free.value(poses.multiply(seen.tool, memory.grip)) - memory.value
        gone = law.shift(memory.value, self._tool(seen, memory, 0.0)[:, :3], seen.tool[:, :3])
        away = distance_of(seen, self.target)
        return memory.way * xp.where(away < LEAST_REACH, turned * memory.reach, gone * away)

    def advance(self, action: Array, seen: Seen, memory: HoldTurnedMemory) -> HoldTurnedMemory:
        """See `Pressing.advance`."""
        farthest = array_namespace(memory.way).maximum(memory.farthest, self.gone(seen, memory))
        return super().advance(action, seen, memory._replace(farthest=farthest))

    def led_to(self, seen: Seen, memory: HoldTurnedMemory) -> tuple[Array, Array]:
        """See `Pressing.led_to`: more off the stop, where a spring turns it, and where it does not count."""
        back, first = memory.farthest - self.gone(seen, memory), seen.elapsed < FIRST
        wanted = (self.least + self.most) / 2 + PRESSES_ON * poses.clip(back - BACK, 0.0, math.inf)
        hardest = MOSTLY * self.most + 0.0 * wanted
        xp = array_namespace(wanted)
        return xp.where(first, hardest, xp.minimum(wanted, hardest)), (back <= OFF) & ~first

    def commanded(self, seen: Seen, after: HoldTurnedMemory) -> Command:
        """A little beyond the stop."""
        return Command(tool=self._tool(seen, after, after.pushed / after.reach))

    def maintained(self, goal: str, seen: Seen, memory: HoldTurnedMemory) -> Array:
        """The handle may still be in the hand."""
        return about_handle(seen, self.target)

    def sufficient_cost(self, known: Known, memory: HoldTurnedMemory) -> Array:
        """How far the part truly is from its stop, over what counts as there."""
        law, xp = known.world.object(self.target).joints, array_namespace(memory.way)
        stop = xp.where(memory.way > 0.0, law.limits[:, 1], law.limits[:, 0])
        return abs(law.value(known.object(self.target)) - stop) / AT_STOP

    def _tool(self, seen: Seen, memory: HoldTurnedMemory, beyond: Array | float) -> Array:
        """Tool poses ``(N, 7)`` so many radians beyond where it began."""
        part = seen.model(self.target).joints.pose(memory.value + memory.way * beyond)
        return poses.multiply(part, poses.inverse(memory.grip))
