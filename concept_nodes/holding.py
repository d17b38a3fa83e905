"""When an object counts as held, judged from what a robot can observe."""

from __future__ import annotations

from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.outcomes import Possible, register_reason
from bt_tasksim.core.poses import Array, array_namespace, localise, norm
from bt_tasksim.core.units import METRES

NOT_HELD = register_reason("not_held", "{object} is not held ({distance} from the tool)", distance=METRES)
HOLDING = "holding"
"""Name of the goal that `Grasp` reaches, `Pick`, `Bring` and `Place` maintain, and `Release` ends."""
REACH = 0.03
"""Metres by which the estimate of something that is held may lie outside the grasp."""
BETWEEN = 0.003
"""The same of what is between the fingers."""


def tool_distance(seen: Seen, target: str) -> Array:
    """Distance ``(N,)`` in metres between the tool origin and the nearest point of the object's box.

    The box is the object's nominal bounding box at its estimated pose.
    """
    beside = abs(localise(seen.object(target), seen.tool[:, :3])) - seen.model(target).extent / 2
    xp = array_namespace(beside)
    return norm(xp.maximum(beside, xp.zeros_like(beside)))


def holding(seen: Seen, target: str, reach: float = REACH) -> Array:
    """Boolean ``(N,)``: opposing fingertips touch something, and the object is where the tool is.

    Args:
        seen: What is seen.
        target: The object.
        reach: Metres by which the estimate may lie outside the grasp.
    """
    return seen.opposed() & (tool_distance(seen, target) < reach)


def may_hold(seen: Seen, target: str) -> Array:
    """Boolean ``(N,)``: an object that was grasped may still be in the hand.

    What is between the fingers and touched by one of them may be held: a finger may not be felt for an
    instant, and a hand of many fingers may press a thing against its palm, or with a finger's side, where
    nothing is felt. What falls is soon away from the tool.
    """
    distance = tool_distance(seen, target)
    felt = array_namespace(distance).any(seen.contacts, axis=-1)
    return (seen.opposed() & (distance < REACH)) | (felt & (distance < BETWEEN))


def not_held(seen: Seen, target: str) -> Possible:
    """The outcome that an object is not in the hand, where it is not, see `may_hold`."""
    held = may_hold(seen, target)
    return NOT_HELD.where(~held, object=target, distance=tool_distance(seen, target))
