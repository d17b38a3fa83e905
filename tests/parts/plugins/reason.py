"""A reason from outside, beside the condition that gives it: an object stands too far away."""

from bt_tasksim.concept.parameters import Metres
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.outcomes import Possible, register_reason
from bt_tasksim.core.poses import norm
from bt_tasksim.core.units import METRES
from concept_nodes import Pick

TOO_FAR = register_reason(
    "too_far", "{object} is {distance} away, more than {limit}", distance=METRES, limit=METRES
)


class NearPick(Pick):
    """A pick that stays near the robot.

    Args:
        limit: How far away the object may be.
    """

    limit: Metres = 0.8

    def initial_state(self, seen: Seen) -> tuple[Possible, ...]:
        """The object must be near, and in the hand."""
        distance = norm(seen.object(self.target)[:, :3])
        far = TOO_FAR.where(distance > self.limit, object=self.target, distance=distance, limit=self.limit)
        return far, super().initial_state(seen)
