"""What is under an object: a place, another object, or nothing that is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.world import is_container
from bt_tasksim.demos_decomp.log import Demonstration, Floats, Surface
from bt_tasksim.demos_decomp.signals import SmoothMotion

REACH = 0.03
"""Metres by which tracking and calibration may misjudge the height of a surface under a resting object."""

MARGIN = 0.02
"""Metres by which a centre may lie outside a surface that carries it."""


@dataclass(frozen=True)
class Support:
    """A surface under an object.

    Attributes:
        name: Place or object.
        origin: ``(3,)`` its origin in the robot base frame, metres.
        gap: Metres from the surface up to the object's lowest point.
        is_bin: It is the bottom of a bin.
    """

    name: str
    origin: Floats
    gap: float
    is_bin: bool = False


def half_height(pose: Floats, size: Floats) -> Floats:
    """Half the vertical extent ``(...)`` in metres of boxes of ``size (3,)`` at poses ``(..., 7)``."""
    up = poses.rotate(poses.quat_conjugate(pose[..., 3:]), np.broadcast_to([0.0, 0, 1], pose[..., :3].shape))
    return np.asarray(np.abs(up) @ size / 2)


def over(surface: Surface, point: Floats, margin: float = MARGIN) -> bool:
    """Whether a point ``(3,)`` lies over or under a surface, seen along the surface's normal."""
    inside = poses.transform(poses.inverse(surface.pose), point)[:2] - surface.centre
    return bool((np.abs(inside) <= surface.extent / 2 + margin).all())


def supports_under(
    shown: Demonstration, motion: SmoothMotion, target: str, index: int, pose: Floats | None = None
) -> list[Support]:
    """Everything known that is over or under an object's centre, smallest gap first.

    Of surfaces of equal height (a spot on a table) the smaller one comes first.

    Args:
        shown: The demonstration, for places and sizes.
        motion: The same, evenly sampled.
        target: The object.
        index: Sample in time, for where the other objects are.
        pose: ``(7,)`` pose of the object, where not that of the sample.
    """
    at = motion.objects[target][index] if pose is None else pose
    bottom = float(at[2] - half_height(at, shown.objects[target].size))
    found: list[tuple[float, float, Support]] = []
    for name, surface in shown.places.items():
        if over(surface, at[:3]):
            gap = bottom - float(surface.pose[2])
            support = Support(name, surface.pose[:3], gap, is_container(surface.kind))
            found.append((gap, float(np.prod(surface.extent)), support))
    for name, track in shown.objects.items():
        other = motion.objects[name][index]
        if name == target or np.linalg.norm(other[:2] - at[:2]) > track.size[:2].max() / 2 + MARGIN / 2:
            continue
        gap = bottom - float(other[2] + half_height(other, track.size))
        found.append((gap, float(np.prod(track.size[:2])), Support(name, other[:3], gap)))
    return [support for _, _, support in sorted(found, key=lambda f: (round(abs(f[0]) / 0.015), f[1]))]


def resting_on(
    shown: Demonstration, motion: SmoothMotion, target: str, index: int, pose: Floats | None = None
) -> Support | None:
    """The surface that carries a resting object, None where no known one is within `REACH`.

    Arguments as in `supports_under`.
    """
    near = [s for s in supports_under(shown, motion, target, index, pose) if abs(s.gap) <= REACH]
    return near[0] if near else None


def bin_under(shown: Demonstration, motion: SmoothMotion, target: str, index: int) -> Support | None:
    """The bin over or in which an object is at a sample, None where there is none."""
    under = supports_under(shown, motion, target, index)
    return next((s for s in under if s.is_bin and s.gap > -REACH), None)
