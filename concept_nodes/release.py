"""Release: open the hand and draw it back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Metres, MetresPerSecond, Newtons, ObjectName, PlaceName, Seconds
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.holding import HOLDING
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, force_at_wrist, strain
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import COUNT, NEWTONS, SHARE
from bt_tasksim.core.world import Command
from bt_tasksim.planning.reference_motion import Path, plan, sample

OPENED = Form(
    "hand {opening} open, {contacts} fingertips in contact, {force} at the wrist",
    {"opening": SHARE, "contacts": COUNT, "force": NEWTONS},
)


class ReleaseMemory(NamedTuple):
    """What a release remembers in ``N`` worlds.

    Attributes:
        path: Tool path away from the object.
        start: Closure ``(N,)`` at the begin.
        opened: Seconds ``(N,)`` since the hand was seen open; negative before.
    """

    path: Path
    start: Array
    opened: Array


@register("concept")
class Release(ConceptModel[ReleaseMemory]):
    """Let an object go (breaks the hand's contacts): the hand opens, then the tool draws back.

    Args:
        target: The held object.
        into: Where it falls, when it is let go above a container; for the record.
        retreat: How far the tool draws back, against its approach.
        opening: Time in which the hand opens.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    into: PlaceName | None = None
    retreat: Metres = 0.12
    opening: Seconds = 0.4
    speed: MetresPerSecond = 0.3
    force_limit: Newtons = FORCE_LIMIT

    ends = (HOLDING,)
    contact = ContactChange(ContactState.FT, ContactState.NC, to="hand")
    presentation = Presentation(
        colour="#c0504d",
        spoken=r"releas|let(?:ting)? .*go|\bdrop|throw|open my hand",
        sayings=("and let go", "release the {}", "I let it go"),
    )
    default_timeout = 8.0
    default_tolerance = 0.01

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Into what, where it falls."""
        return f"into {parameters['into']}" if "into" in parameters else ""

    def begin(self, seen: Seen) -> ReleaseMemory:
        """A straight path back."""
        back = poses.shifted(seen.tool, -self.retreat * poses.z_axis(seen.tool[:, 3:]))
        path = plan([seen.tool, back], self.speed, samples=2)
        return ReleaseMemory(path, seen.closure, -array_namespace(seen.tool).ones_like(path.duration))

    def command(self, action: Array, seen: Seen, memory: ReleaseMemory) -> Command:
        """Open, then draw back."""
        share = poses.clip(1.0 - seen.elapsed / self.opening, 0.0, 1.0)
        since = poses.clip(memory.opened, 0.0, math.inf)
        return Command(tool=sample(memory.path, since), hand=(memory.start * share)[:, None])

    def advance(self, action: Array, seen: Seen, memory: ReleaseMemory) -> ReleaseMemory:
        """Notice when the hand is open."""
        xp = array_namespace(seen.tool)
        open_now = (seen.elapsed > self.opening) & (seen.closure < 0.15)
        begun = xp.where(open_now, xp.zeros_like(memory.opened), memory.opened)
        going = memory.opened >= 0.0
        return memory._replace(opened=xp.where(going, memory.opened + seen.world.control_period, begun))

    def limits(self, seen: Seen, memory: ReleaseMemory) -> tuple[Limit, ...]:
        """The force at the wrist."""
        return (strain(seen, self.force_limit),)

    def done(self, seen: Seen, memory: ReleaseMemory) -> Array:
        """The hand is open, touches nothing, and has drawn back."""
        gap = poses.norm(seen.tool[:, :3] - memory.path.table[:, -1, :3])
        free = ~array_namespace(gap).any(seen.contacts, axis=-1)
        return (memory.opened >= memory.path.duration) & (gap < self.tolerance) & free

    def necessary_cost(self, seen: Seen, memory: ReleaseMemory) -> Array:
        """Share of the fingertips that still touch something."""
        xp = array_namespace(seen.tool)
        return poses.mean(xp.astype(seen.contacts, seen.tool.dtype))

    def sufficient_cost(self, known: Known, memory: ReleaseMemory) -> Array:
        """1 while the hand still presses on the object."""
        force = known.hand_force(self.target)
        return array_namespace(force).astype(force > 0.05, force.dtype)

    def explain(self, seen: Seen, memory: ReleaseMemory) -> Statement:
        """How far the hand is open and what it touches."""
        return OPENED(
            opening=1.0 - seen.closure,
            contacts=array_namespace(seen.tool).count_nonzero(seen.contacts, axis=-1),
            force=force_at_wrist(seen),
        )
