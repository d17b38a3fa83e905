"""When an object counts as held, judged from what a robot can observe."""

from __future__ import annotations

import math

import numpy as np

from bt_tasksim.concept.context import Seen
from bt_tasksim.core.outcomes import Outcome, register_reason
from bt_tasksim.core.poses import Array, array_namespace, constant, inverse, transform
from bt_tasksim.core.units import METRES

NOT_HELD = register_reason("not_held", "{object} is not held ({distance} from the tool)", distance=METRES)
HOLDING = "holding"
"""Name of the goal that `Grasp` reaches, `Pick`, `Bring` and `Place` maintain, and `Release` ends."""


def tool_distance(seen: Seen, target: str) -> Array:
    """Distance ``(...)`` in metres between the tool origin and the nearest point of the object's box.

    The box is the object's nominal bounding box at its estimated pose.
    """
    local = transform(inverse(seen.object(target)), seen.tool[..., :3])
    if type(local) is np.ndarray and local.ndim == 1:  # one instant, in plain floats
        outside = [
            max(abs(x) - v / 2, 0.0) for x, v in zip(local.tolist(), seen.model(target).extent, strict=True)
        ]
        return np.float64(math.hypot(*outside))
    xp = array_namespace(local)
    half = constant([v / 2 for v in seen.model(target).extent], local)
    outside = xp.maximum(xp.abs(local) - half, xp.zeros_like(local))
    return xp.sqrt(xp.sum(outside * outside, axis=-1))


def holding(seen: Seen, target: str, reach: float = 0.03) -> Array:
    """Boolean ``(...)``: opposing fingertips touch something, and the object is where the tool is.

    Args:
        seen: What is seen.
        target: The object.
        reach: Metres by which the estimate may lie outside the grasp.
    """
    return seen.opposed() & (tool_distance(seen, target) < reach)


def not_held(seen: Seen, target: str) -> Outcome | None:
    """The outcome that an object is not in the hand; None where it is."""
    if bool(holding(seen, target)):
        return None
    return NOT_HELD(object=target, distance=tool_distance(seen, target))
