"""Place: put a held object down until it is felt to stand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.demonstrated import position_words, straight_words
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Direction, Metres, MetresPerSecond, Newtons, ObjectName, PlaceName
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.concept_nodes.bring import destination, standing_pose
from bt_tasksim.concept_nodes.holding import HOLDING, holding, not_held
from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, strain
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import Form, Possible, Statement
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, NEWTONS
from bt_tasksim.core.world import Command
from bt_tasksim.planning.reference_motion import Path, plan, sample

FELT_AND_MISSED = Form(
    "{felt:.1f} felt, {object} {distance} from its spot", {"felt": NEWTONS, "distance": METRES}
)
FELT = 2
"""Ticks in a row for which the support must be felt."""


class PlaceMemory(NamedTuple):
    """What a place remembers in ``N`` worlds.

    Attributes:
        path: Tool path to the deepest pose that is tried.
        baseline: Force ``(N,)`` against the direction of placing when it began, N.
        felt: Ticks ``(N,)`` in a row with the support's force.
        progress: Seconds ``(N,)`` of the path that have been commanded.
    """

    path: Path
    baseline: Array
    felt: Array
    progress: Array


@register("concept")
class Place(ConceptModel[PlaceMemory]):
    """Put a held object down on a place or on another object (makes contact: NC to PC).

    The object goes over the place's origin and down along ``direction``, slowly, and stops when the wrist
    feels the support, or ``overshoot`` below where the support should be.

    Args:
        target: The held object.
        on: The place, or the object to put it on.
        direction: Direction in which it is put down, robot base frame.
        distance: How far it is put down at most; by default to where the support should be.
        overshoot: How much deeper is tried.
        press: Force that counts as support.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    on: PlaceName
    direction: Direction = (0.0, 0.0, -1.0)
    distance: Metres | None = None
    overshoot: Metres = 0.006
    press: Newtons = 3.0
    speed: MetresPerSecond = 0.08
    force_limit: Newtons = FORCE_LIMIT

    maintains = (HOLDING,)
    contact = ContactChange(ContactState.NC, ContactState.PC)
    presentation = Presentation(
        colour="#8a56a8",
        spoken=r"plac|put|set(?:ting)? .* down|stand .* on|\blay",
        sayings=("put it down on the {}", "I place it on the {}", "set it down gently"),
        says_destination=True,
    )
    default_timeout = 10.0

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """Onto what, and how far which way."""
        said = [f"onto {parameters['on']}"] if "on" in parameters else []
        if "position" in parameters:
            said.append(f"to {position_words(parameters['position'])}")
        return ", ".join([*said, *([straight_words(parameters)] if "distance" in parameters else [])])

    @classmethod
    def from_task(cls, task: Task, later: Sequence[Task]) -> dict[str, Any]:
        """What it is put on; how far it goes is felt.

        Raises:
            InputError: The log does not name what it was put on.
        """
        given = task.parameters
        if not given.get("on"):
            raise InputError(
                f"'{given['target']}' was placed on something that the log does not name: "
                f"name the surface in the log's 'places'"
            )
        return {"target": given["target"], "on": given["on"]}

    def initial_state(self, seen: Seen) -> Possible:
        """The object must be in the hand."""
        return not_held(seen, self.target)

    def begin(self, seen: Seen) -> PlaceMemory:
        """A straight path down to the place's origin."""
        xp, now = array_namespace(seen.tool), seen.object(self.target)
        frame, _ = destination(seen, self.on)
        d = poses.constant(self.direction, now)
        goal = poses.shifted(standing_pose(frame, now, seen.model(self.target)), self.overshoot * d)
        if self.distance is not None:
            along = poses.dot(goal[:, :3] - now[:, :3], d)
            beyond = xp.minimum(self.distance + self.overshoot - along, xp.zeros_like(along))
            goal = poses.shifted(goal, beyond[:, None] * d)
        tool_goal = poses.multiply(goal, poses.relative(now, seen.tool))
        path = plan([seen.tool, tool_goal], self.speed, samples=2)
        nothing = xp.zeros_like(path.duration)
        felt = xp.astype(nothing, xp.int64)
        return PlaceMemory(path, self._force(seen), felt, nothing - seen.world.control_period)

    def command(self, action: Array, seen: Seen, memory: PlaceMemory) -> Command:
        """Follow the path, and stop on it as long as the support is felt; the hand keeps its grip."""
        return Command(tool=sample(memory.path, self._progress(seen, memory)))

    def advance(self, action: Array, seen: Seen, memory: PlaceMemory) -> PlaceMemory:
        """Count the ticks at which the support is felt."""
        xp = array_namespace(seen.tool)
        felt = xp.where(self._supported(seen, memory), memory.felt + 1, xp.zeros_like(memory.felt))
        return memory._replace(felt=felt, progress=self._progress(seen, memory))

    def limits(self, seen: Seen, memory: PlaceMemory) -> tuple[Limit, ...]:
        """The force at the wrist."""
        return (strain(seen, self.force_limit),)

    def done(self, seen: Seen, memory: PlaceMemory) -> Array:
        """The support is felt, or the object is where it should stand."""
        return (memory.felt >= FELT) | (memory.progress >= memory.path.duration + 0.2)

    def maintained(self, goal: str, seen: Seen, memory: PlaceMemory) -> Array:
        """The object is still in the hand."""
        return holding(seen, self.target)

    def necessary_cost(self, seen: Seen, memory: PlaceMemory) -> Array:
        """Distance of the object from where it should stand, metres."""
        frame, _ = destination(seen, self.on)
        now = seen.object(self.target)
        return poses.norm(now[:, :3] - standing_pose(frame, now, seen.model(self.target))[:, :3])

    def sufficient_cost(self, known: Known, memory: PlaceMemory) -> Array:
        """1 unless the object touches its support."""
        xp, cost = array_namespace(known.hidden.tool_pose), known.hidden.tool_pose[:, 0]
        return xp.where(known.supported(self.target), xp.zeros_like(cost), xp.ones_like(cost))

    def explain(self, seen: Seen, memory: PlaceMemory) -> Statement:
        """What is felt, and how far the object is from where it should stand."""
        return FELT_AND_MISSED(
            felt=self._force(seen) - memory.baseline,
            object=self.target,
            distance=self.necessary_cost(seen, memory),
        )

    def _force(self, seen: Seen) -> Array:
        """Force ``(N,)`` in N against the direction of placing."""
        force = poses.rotate(seen.tool[:, 3:], seen.wrench[:, :3])
        return -poses.dot(force, poses.constant(self.direction, force))

    def _progress(self, seen: Seen, memory: PlaceMemory) -> Array:
        xp = array_namespace(seen.tool)
        on = memory.progress + seen.world.control_period
        return xp.where(self._supported(seen, memory), memory.progress, on)

    def _supported(self, seen: Seen, memory: PlaceMemory) -> Array:
        return (self._force(seen) - memory.baseline > self.press) & (seen.elapsed > 0.25)
