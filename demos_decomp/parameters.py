"""Parameters of recognised tasks: directions, distances, axes and via-points."""

from __future__ import annotations

from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.demos_decomp.log import Floats
from bt_tasksim.demos_decomp.segmentation import HandClosed
from bt_tasksim.demos_decomp.signals import RATE, SmoothMotion, simplified
from bt_tasksim.demos_decomp.support import Support

VIA_TOLERANCE = 0.02
"""Metres by which the polyline through the via-points may leave the path that was shown."""

PATH_POINTS = 32


def grasp_parameters(motion: SmoothMotion, hold: HandClosed) -> dict[str, Any]:
    """Target, approach direction and closing axis, averaged over the last 0.2 s before the hand is closed."""
    span = slice(max(0, hold.first - int(0.2 * RATE)), hold.first + 1)
    hand, target = motion.hand[span, 3:], motion.objects[hold.target][span, 3:]
    approach = poses.rotate(hand, np.broadcast_to([0.0, 0, 1], (len(hand), 3)))
    closing = poses.rotate(
        poses.quat_conjugate(target), poses.rotate(hand, np.broadcast_to([0.0, 1, 0], (len(hand), 3)))
    )
    return {
        "target": hold.target,
        "approach": unit(approach.mean(axis=0)),
        "closing": undirected(unit(closing.mean(axis=0))),
    }


def straight_parameters(start: Floats, end: Floats) -> dict[str, Any]:
    """Direction (unit vector) and distance in metres from one point ``(3,)`` to another."""
    distance = float(np.linalg.norm(end - start))
    return {"direction": unit(end - start), "distance": distance}


def bring_parameters(path: Floats, destination: Support | None) -> tuple[dict[str, Any], Floats]:
    """Destination and via-points of a path.

    Args:
        path: ``(N, 3)`` positions of the target, robot base frame, metres.
        destination: Where it went, if that is known.

    Returns:
        The parameters, and the path as `PATH_POINTS` points evenly spaced along it; via-points and path are
        relative to the destination's origin (or to the last position), axes of the robot base frame.
    """
    parameters: dict[str, Any] = {}
    if destination is not None:
        parameters["to"] = destination.name
        origin = destination.origin
    else:
        parameters["position"] = origin = path[-1]
    relative = path - origin
    parameters["via"] = [relative[i] for i in simplified_path(relative)]
    return parameters, evenly_spaced(relative)


def simplified_path(path: Floats) -> list[int]:
    """Indices of the via-points of a path ``(N, 3)``."""
    return [int(i) for i in simplified(path, VIA_TOLERANCE)[1:-1]]


def evenly_spaced(path: Floats, count: int = PATH_POINTS) -> Floats:
    """``(count, 3)`` points at equal distances along a path ``(N, 3)``."""
    steps = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    wanted = np.linspace(0, steps[-1], count)
    return np.stack([np.interp(wanted, steps, column) for column in path.T], axis=1)


def unit(vector: Floats) -> Floats:
    """The vector scaled to length 1; up where it has no length."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])


def undirected(axis: Floats) -> Floats:
    """The axis or its opposite, so that its largest component is positive: fingers close from both sides."""
    return -axis if axis[int(np.argmax(np.abs(axis)))] < 0 else axis
