"""An observable from outside, and a concept that looks at it: how far apart the fingertips are."""

from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import ObjectName
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core import poses
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.core.observables import Observable
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Command, Observation
from bt_tasksim.robot.description import RobotDescription


@register("observable", "span")
class Span(Observable):
    """Distance between the first and the last fingertip."""

    shape = "(N,)"
    unit = "m"
    gap = "small"
    why = "encoders and a calibrated hand"

    def read(self, observation: Observation, world: WorldFacts) -> Array:
        return poses.norm(observation.tips[:, 0, :] - observation.tips[:, -1, :])


@register("concept")
class Pinch(ConceptModel):
    """Close the hand bit by bit until the fingertips are 2 cm apart, or touch something.

    Args:
        target: What is between them.
    """

    target: ObjectName
    is_task_model = False
    actions = 1
    observables = ("span", "contacts")

    @classmethod
    def layout(cls, robot: RobotDescription) -> dict[str, int]:
        return {"span": 1, "contacts": len(robot.tips)}

    def features(self, seen: Seen, memory: None) -> Array:
        xp = array_namespace(seen.tool)
        span = seen.observable("span")[:, None] / 0.1
        return xp.concat([span, xp.astype(seen.contacts, seen.tool.dtype)], axis=-1)

    def command(self, action: Array, seen: Seen, memory: None) -> Command:
        closure = poses.clip(seen.closure[:, None] + 0.1 + 0.05 * action, 0.0, 1.0)
        return Command(hand=closure)

    def done(self, seen: Seen, memory: None) -> Array:
        return (seen.observable("span") < 0.02) | seen.opposed()

    def necessary_cost(self, seen: Seen, memory: None) -> Array:
        """Metres between the fingertips."""
        return seen.observable("span")

    def sufficient_cost(self, known, memory: None) -> Array:
        force = known.hand_force(self.target)
        xp = array_namespace(force)
        return xp.where(force > 0.1, xp.zeros_like(force), 2.0 * xp.ones_like(force))
