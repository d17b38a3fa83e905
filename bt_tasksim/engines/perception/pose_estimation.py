"""The pose of a known object from its segment in one RGB-D image.

Most things stand: their height is known from the surface below and only place and heading are looked for,
from several headings at once. Where that does not explain the image, the object lies or leans, and all six
motions are looked for, from every side that it may lie on.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel, PlaceModel
from bt_tasksim.engines.perception.registration import (
    FREE,
    UPRIGHT,
    DepthView,
    Fit,
    ModelPoints,
    judge_fit,
    register,
    sample_surface,
)
from bt_tasksim.scene.shapes import Shape

GOOD = 0.2
"""Cost of a fit, see `Fit`, up to which a standing pose is taken without looking for others."""
POOR = 0.5
"""Cost beyond which no pose is believed."""
ALIKE = 0.04
"""Difference of two fits' costs that says nothing: the usual explanation is believed then."""
NEARLY_UPRIGHT, NEAR_SURFACE = math.radians(8.0), 0.008
"""Radians and metres within which what was believed to be aslant, or above or in a surface, stands on it."""
HELD = (0.3, 0.02, 0.35)
"""Cost of a fit to what the hand holds, and metres and radians that it may have moved in the hand, up to
which such a look is believed."""
_COARSE, _FINE = (120, 350), (700, 1600)
"""Numbers of points seen and of model points, for trying and for the last word."""


@dataclass(frozen=True, eq=False)
class Target:
    """An object that is looked for: its category and its geometry."""

    model: ObjectModel
    shape: Shape

    @property
    def diameter(self) -> float:
        """Length of the bounding box's diagonal, metres."""
        return math.hypot(*self.model.extent)

    @property
    def headings(self) -> Array:
        """Headings ``(k,)`` in radians from which a fit finds every other one, up to symmetry."""
        n = self.model.symmetry
        if n == 0:
            return np.zeros(1)
        return np.arange(8) * (2 * math.pi / n / 8)


def estimate_pose(
    target: Target, view: DepthView, places: Sequence[PlaceModel], before: Array | None = None
) -> Fit | None:
    """The pose of an object.

    Args:
        target: The object.
        view: Its points and the image.
        places: Surfaces on which it may stand.
        before: Pose ``(7,)`` at which it last was seen, if any. It is believed, but for what the picture
            shows to be a little else, unless another one explains the picture clearly better.

    Returns:
        The best fit, or None where no pose explains what is seen.
    """
    points = sample_surface(target.shape)
    still = None if before is None else stay(target, view, before, places)
    best = stand_on(target, view, places, points, before)
    if best is None or best.cost >= GOOD:
        free = lie_about(target, view, places, points, before)
        best = free if best is None or free.cost < best.cost - ALIKE else best
    best = still if still is not None and still.cost < best.cost + ALIKE else best
    return best if best.cost < POOR else None


def follow(target: Target, view: DepthView, start: Array, places: Iterable[PlaceModel] = ()) -> Fit:
    """The pose near ``start (7,)``: for an object in the hand, of which little is seen.

    While it still stands on one of the places it only slides and turns there; else all motions are free.
    """
    half = np.array([0.0, 0.0, -target.model.extent[2] / 2])
    foot, up = poses.transform(start, half), poses.z_axis(start[3:])
    stands = up[2] > 0.999 and any(abs(float(foot[2] - place.pose[2])) < 0.003 for place in places)
    points = sample_surface(target.shape)
    return judge_fit(points, view, _near(points, view, start, UPRIGHT if stands else FREE))


def still_held(fit: Fit, before: Array) -> bool:
    """Whether a look at what the hand holds is believed, which was believed to be at ``before (7,)``."""
    moved = float(np.linalg.norm(fit.pose[:3] - before[:3]))
    turned = float(poses.angle_between(fit.pose[3:], before[3:]))
    cost, far, wide = HELD
    return fit.cost < cost and moved < far and turned < wide


def stay(target: Target, view: DepthView, start: Array, places: Sequence[PlaceModel]) -> Fit:
    """The pose near ``start (7,)`` of an object that rests there: upright on a surface, if it nearly is."""
    points = sample_surface(target.shape)
    surface = _below(target, start, places)
    if surface is None or float(poses.tilt(start[3:])) > NEARLY_UPRIGHT:
        pose = _settled(_near(points, view, start, FREE), target, places)
        return judge_fit(points, view, pose)
    level = float(surface.pose[2]) + target.model.extent[2] / 2
    heading = 2 * math.atan2(float(start[6]), float(start[3]))
    upright = poses.pose([*start[:2], level], poses.yaw(heading))
    return judge_fit(points, view, _near(points, view, upright, UPRIGHT))


def _near(points: ModelPoints, view: DepthView, start: Array, free: Sequence[int]) -> Array:
    """The pose near ``start (7,)`` that fits best, where the start was believed."""
    seen, model, reach = view.thinned(_FINE[0]), points.thinned(_FINE[1]), (0.006, 0.003)
    return register(model, seen, start, free, steps=15, reach=reach, anchored=True)


def _below(target: Target, pose: Array, places: Sequence[PlaceModel]) -> PlaceModel | None:
    """The place on which an object at a pose nearly stands, or None."""
    level = (place for place in places if poses.z_axis(place.pose[3:])[2] > 0.999)
    return _surface(pose, float(pose[2]) - target.model.extent[2] / 2, level)


def _surface(pose: Array, lowest: float, places: Iterable[PlaceModel]) -> PlaceModel | None:
    """The first place that a pose ``(7,)`` is over, with a surface near a height in metres; or None."""
    for place in places:
        local = poses.transform(poses.inverse(place.pose), pose[:3])
        inside = all(abs(local[i] - place.centre[i]) < place.extent[i] / 2 for i in range(2))
        if inside and abs(lowest - float(place.pose[2])) < NEAR_SURFACE:
            return place
    return None


def stand_on(
    target: Target,
    view: DepthView,
    places: Sequence[PlaceModel],
    points: ModelPoints,
    before: Array | None = None,
) -> Fit | None:
    """The best pose at which the object stands upright on one of the places, or None."""
    height = target.model.extent[2]
    middle = np.median(view.points, axis=0)
    best: Fit | None = None
    seen: set[int] = set()
    for place in places:
        up = poses.z_axis(place.pose[3:])
        local = poses.transform(poses.inverse(place.pose), middle)
        level = float(place.pose[2])
        inside = all(abs(local[i] - place.centre[i]) < place.extent[i] / 2 + 0.05 for i in range(2))
        if up[2] < 0.999 or not inside or not -0.02 < local[2] < height + 0.02 or round(1e5 * level) in seen:
            continue
        seen.add(round(1e5 * level))
        starts = [
            poses.pose([*_behind(middle, view, target)[:2], level + height / 2], poses.yaw(angle))
            for angle in target.headings
        ]
        if before is not None:
            heading = 2 * math.atan2(float(before[6]), float(before[3]))
            starts.append(poses.pose([*before[:2], level + height / 2], poses.yaw(heading)))
        fit = _best(target, points, view, starts, UPRIGHT, keep=2)
        if best is None or fit.cost < best.cost:
            best = fit
    return best


def lie_about(
    target: Target,
    view: DepthView,
    places: Sequence[PlaceModel],
    points: ModelPoints,
    before: Array | None = None,
) -> Fit:
    """The best pose with all motions free, but on the surface below where it nearly touches it."""
    position = _behind(np.median(view.points, axis=0), view, target)
    starts = [poses.pose(position, q) for q in _orientations(target)]
    if before is not None:
        starts.append(np.concatenate([position, before[3:]]))
        starts.append(np.array(before, float))
    return _best(target, points, view, starts, FREE, keep=6, places=places)


def _best(
    target: Target,
    points: ModelPoints,
    view: DepthView,
    starts: Sequence[Array],
    free: Sequence[int],
    keep: int,
    places: Sequence[PlaceModel] = (),
) -> Fit:
    """Fit from every start with few points, then the best ``keep`` of them with many."""
    few, coarse = view.thinned(_COARSE[0]), points.thinned(_COARSE[1])
    if len(starts) > keep:
        tried = [judge_fit(coarse, few, register(coarse, few, s, free, steps=8)) for s in starts]
        starts = _distinct(sorted(tried, key=_unlikely), keep, target.model)
    many, fine = view.thinned(_FINE[0]), points.thinned(_FINE[1])
    found = [_settled(register(fine, many, s, free), target, places) for s in starts]
    return min((judge_fit(points, view, pose) for pose in found), key=_unlikely)


def _unlikely(fit: Fit) -> float:
    """Its cost, and a little for how far it is from upright: a box looks the same upside down."""
    return fit.cost + ALIKE * float(poses.tilt(fit.pose[3:])) / math.pi


def _distinct(fits: Sequence[Fit], n: int, model: ObjectModel) -> list[Array]:
    """The first ``n`` poses that are more than some degrees apart, up to the symmetry about z."""
    kept: list[Array] = []
    for fit in fits:
        if all(_apart(fit.pose[3:], other[3:], model) > math.radians(12.0) for other in kept):
            kept.append(fit.pose)
        if len(kept) == n:
            break
    return kept


def _apart(a: Array, b: Array, model: ObjectModel) -> float:
    """Radians between two rotations ``(4,)`` of an object, up to its symmetry about z."""
    if model.symmetry == 0:
        axis = np.array([0.0, 0.0, 1.0])
        return math.acos(min(1.0, max(-1.0, float(poses.rotate(a, axis) @ poses.rotate(b, axis)))))
    turns = [poses.yaw(2 * math.pi * k / model.symmetry) for k in range(model.symmetry)]
    return min(float(poses.angle_between(a, poses.quat_multiply(b, turn))) for turn in turns)


def _behind(middle: Array, view: DepthView, target: Target) -> Array:
    """The object's likely centre: behind the middle of what is seen of it, as the camera looks."""
    ray = middle - view.camera.pose[:3]
    ray = ray / np.linalg.norm(ray)
    return middle + 0.3 * min(target.model.extent) * ray


def _orientations(target: Target) -> list[Array]:
    """Rotations ``(4,)`` with each side of the object down and at several headings."""
    model = target.model
    down = [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)]
    if model.symmetry != 0:
        down += [(-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)]
        down += [tuple(s * v for v in axis) for axis in model.grasp_axes[1:] for s in (1, -1)]  # type: ignore[misc]
    out = []
    for axis in down:
        round_up = model.symmetry == 0 and abs(axis[2]) > 0.5
        tip = _turning(np.array(axis), np.array([0.0, 0.0, 1.0]))
        out += [
            poses.quat_multiply(poses.yaw(2 * math.pi * k / 10), tip) for k in range(1 if round_up else 10)
        ]
    return out


def _turning(a: Array, b: Array) -> Array:
    """The shortest rotation ``(4,)`` that turns unit vector ``a`` onto ``b``."""
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1 + 1e-9:
        return np.array([0.0, 1.0, 0.0, 0.0]) if abs(a[0]) < 0.9 else np.array([0.0, 0.0, 1.0, 0.0])
    return poses.normalise(np.array([1.0 + cosine, *axis]))


def _settled(pose: Array, target: Target, places: Sequence[PlaceModel]) -> Array:
    """The same pose, moved up or down to touch the surface below where it nearly does."""
    lowest = float(np.min(poses.transform(pose, target.shape.visual.vertices)[:, 2]))
    surface = _surface(pose, lowest, places)
    if surface is None:
        return pose
    return pose - np.array([0.0, 0.0, lowest - float(surface.pose[2]), 0.0, 0.0, 0.0, 0.0])
