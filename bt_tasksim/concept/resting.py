"""What is seen to stand is put onto what it stands on: supports are known better than objects are seen."""

from __future__ import annotations

import math

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel, Obstacle, WorldModel

LEANS = math.radians(8.0)
"""Tilt up to which an object is taken to stand upright; estimates are wrong by some degrees."""
OFF = 0.03
"""Metres between an object's underside and a surface up to which it is taken to stand there: half as much
again as estimates of the level `original` may be wrong by."""
_UP = np.array([0.0, 0.0, 1.0])


def at_rest(world: WorldModel, estimates: Array) -> Array:
    """Poses of a world's objects with those that seem to stand upright right on a surface.

    An object stands on the highest place within `OFF` that its middle is above, or on furniture beside all
    places, as long as it has room there; on another object, where the top of that is nearer. Those that lean,
    those below which there is nothing, and parts of furniture are left as they are.

    Args:
        world: The world.
        estimates: Poses ``(n, 7)`` as they are seen; NaN where one was not.
    """
    found = np.array(estimates, float)
    tops: dict[int, float] = {}
    furniture = [box for box in world.obstacles if _level(box)]
    for k in np.argsort(found[:, 2], kind="stable").tolist():
        model, pose = world.objects[k], found[k]
        upright = _upright(pose, model)
        if upright is None:
            continue
        if model.joint is not None:  # where it can be, its joint says, and it may bear others
            tops[k] = float(pose[2]) + model.extent[2] / 2
            continue
        bottom = float(pose[2]) - model.extent[2] / 2
        # A goal in the air carries nothing.
        places = [p for p in world.places.values() if p.fixture and _above(pose, p.pose, p.centre, p.extent)]
        levels = [float(p.pose[2]) for p in places]
        levels += [_top(box) for box in furniture if _bears(box, pose, model)]
        level = max((z for z in levels if abs(bottom - z) <= OFF), default=math.inf)
        for other, top in tops.items():
            on = _above(pose, found[other], (0.0, 0.0), world.objects[other].extent[:2])
            if on and abs(bottom - top) <= min(OFF, abs(bottom - level)):
                level = top
        if math.isinf(level):
            continue
        found[k, 2], found[k, 3:] = level + model.extent[2] / 2, upright
        tops[k] = level + model.extent[2]
    return found


def _upright(pose: Array, model: ObjectModel) -> Array | None:
    """The rotation ``(4,)`` of an object that stands as it seems to; None where it does not."""
    if not np.isfinite(pose).all():
        return None
    up = poses.rotate(pose[3:], _UP)
    if model.cubic:
        axes = poses.to_matrix(pose[3:])
        best = int(np.argmax(np.abs(axes[2])))
        up = axes[:, best] * np.sign(axes[2, best])
    angle = math.acos(min(1.0, max(-1.0, float(up[2]))))
    if angle > LEANS:
        return None
    axis = poses.cross(up, _UP)
    length = float(np.linalg.norm(axis))
    turn = poses.from_rotation_vector(axis * (angle / length if length > 1e-9 else 0.0))
    upright: Array = poses.quat_multiply(turn, pose[3:])
    return upright


def _level(box: Obstacle) -> bool:
    """Whether the top of a box is level."""
    return float(poses.z_axis(np.asarray(box.pose)[3:])[2]) > 1.0 - 1e-9


def _top(box: Obstacle) -> float:
    """Height of a box's top, metres."""
    return float(box.pose[2]) + box.size[2] / 2


def _bears(box: Obstacle, pose: Array, model: ObjectModel) -> bool:
    """Whether the middle of an object is above a box on which it has room: a wall has none."""
    wide = min(box.size[:2]) >= max(model.extent[:2])
    return wide and _above(pose, np.asarray(box.pose), (0.0, 0.0), box.size[:2])


def _above(pose: Array, surface: Array, centre: tuple[float, float], size: tuple[float, float]) -> bool:
    """Whether the middle of an object is above a rectangle of a surface with this pose ``(7,)``."""
    x, y, _ = poses.localise(surface, pose[:3]).tolist()
    return bool(abs(x - centre[0]) <= size[0] / 2 and abs(y - centre[1]) <= size[1] / 2)
