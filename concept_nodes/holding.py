"""When an object counts as held, judged from what a robot can observe."""

from __future__ import annotations

import math

from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.outcomes import Possible, register_reason
from bt_tasksim.core.poses import Array, array_namespace, localise, mean, norm, transform
from bt_tasksim.core.units import METRES

NOT_HELD = register_reason("not_held", "{object} is not held ({distance} from the tool)", distance=METRES)
HOLDING = "holding"
"""Name of the goal that `Grasp` reaches, `Pick`, `Bring` and `Place` maintain, and `Release` ends."""
EMPTY = 0.97
"""Share of its grip beyond which a hand has nothing between its fingers."""
REACH = 0.03
"""Metres by which the estimate of something that is held may lie outside the grasp."""
BETWEEN = 0.003
"""The same of what is between the fingers."""
AT_HANDLE = 0.03
"""Metres from the middle between the fingertips to a handle of a part of furniture, within which they hold
it."""


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
    near = tool_distance(seen, target) < reach
    return seen.opposed() & by_handle(seen, target, near)


def by_handle(seen: Seen, target: str, near: Array) -> Array:
    """Boolean ``(N,)``: an object is in the hand; a part of furniture is where its handle is.

    Args:
        seen: What is seen.
        target: The object.
        near: Booleans ``(N,)``: it is near enough to the tool.
    """
    jointed, xp = seen.model(target).jointed, array_namespace(near)
    return xp.where(jointed, off_handle(seen, target) < AT_HANDLE, near) if bool(xp.any(jointed)) else near


def off_handle(seen: Seen, target: str) -> Array:
    """Distance ``(N,)`` in metres of the middle between the fingertips from the nearest of a part's handles.

    Infinite where it has none.
    """
    model, xp = seen.model(target), array_namespace(seen.tool)
    middle = mean(xp.permute_dims(seen.observation.tips, (0, 2, 1)))
    handles = transform(seen.object(target)[:, None, :], model.handles)
    away = norm(handles - middle[:, None, :])
    return xp.min(xp.where(model.handle_counts, away, xp.full_like(away, math.inf)), axis=-1)


def may_hold(seen: Seen, target: str) -> Array:
    """Boolean ``(N,)``: an object that was grasped may still be in the hand.

    What is between the fingers and touched by one of them may be held: a finger may not be felt for an
    instant, and a hand of many fingers may press a thing against its palm, or with a finger's side, where
    nothing is felt. What falls is soon away from the tool.
    """
    distance = tool_distance(seen, target)
    felt = array_namespace(distance).any(seen.contacts, axis=-1)
    held = (seen.opposed() & (distance < REACH)) | (felt & (distance < BETWEEN))
    return held & by_handle(seen, target, held)


def not_held(seen: Seen, target: str) -> Possible:
    """The outcome that an object is not in the hand, where it is not, see `may_hold`.

    A part of furniture is no object that can be carried.
    """
    held = may_hold(seen, target) & ~seen.model(target).jointed
    return NOT_HELD.where(~held, object=target, distance=tool_distance(seen, target))
