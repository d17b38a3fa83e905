"""Objects of one colour, looked for together: each part of what is seen in it belongs to one of them.

What hangs together is a part; every object is fitted to every part, and the assignment counts that explains
most of what is seen. What the objects found explain is taken away, and the others are looked for in the rest:
things that touch hang together, and what stands on another is found once that is. One that was seen before
is first looked for where it was.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Obstacle, PlaceModel
from bt_tasksim.engines.images import CameraModel
from bt_tasksim.engines.perception.coloured_cloud import ColouredCloud, coloured_cloud
from bt_tasksim.engines.perception.fixture_faces import boxes_near
from bt_tasksim.engines.perception.pose_estimation import (
    POOR,
    Target,
    follow,
    lie_about,
    stand_on,
    stay,
    still_held,
)
from bt_tasksim.engines.perception.registration import DepthView, Fit, judge_fit, sample_surface, seen_through
from bt_tasksim.engines.perception.segmentation import SMALLEST
from bt_tasksim.scene.shapes import Shape

OWN = 0.008
"""Metres from a fitted model within which what is seen is explained by it."""
WITHIN = 0.020
"""Metres from a model within which what is seen may be its, where other things hang together with it."""
SMALL = 0.4
"""Part of an object's diagonal that what is seen of it spans at least: less is but a piece of something."""
FOOT = 0.003
"""Metres by which the lowest point that is seen of a thing is above its foot at least: near a fixture nothing
is taken to be seen (6 mm), and what is seen has errors."""
MARGIN = 0.02
"""Metres that it may span more than an object does: what is seen has errors."""
FAIR = 0.35
"""Cost of a fit in several pictures up to which others need not be looked for: the errors of the cameras'
calibrations come on top of what one picture costs."""
AGREE = 0.2
"""Radians between two cameras' fits up to which the pose between them is tried."""
GONE = 0.5
"""Share of an object in whose place something behind it is seen, from which it is not there any more."""
SIMILAR = 0.015
"""Metres by which two objects' extents differ at most, that might be taken for each other."""
SURE = 0.03
"""Cost by which pictures should be explained better than with two objects exchanged, to tell them apart."""


class ColourView(NamedTuple):
    """A camera's picture: the camera, depth ``(height, width)``, and what shows objects of other colours."""

    camera: CameraModel
    depth: Array
    others: Array


class Sight(NamedTuple):
    """An object that was found: its fit in all pictures, and its points ``(n,)`` of the cloud."""

    fit: Fit
    points: Array


class FitStage(NamedTuple):
    """How objects are looked for: with all motions free, in pieces of a part, up to which cost."""

    free: bool
    pieces: bool
    limit: float


STANDING = (FitStage(False, False, FAIR), FitStage(False, True, FAIR))
STAGES = (*STANDING, FitStage(True, False, FAIR), FitStage(True, True, FAIR), FitStage(True, False, POOR))
"""The usual first: what stands alone, then what touches others, then what lies."""


@dataclass(frozen=True)
class SameColour:
    """Objects of one colour, and what is seen in it.

    Args:
        targets: All objects.
        members: Numbers of those that have the colour.
        pictures: The pictures.
        cloud: What has the colour there.
        boxes: Fixtures.
        places: Surfaces on which an object, by its number, may stand, given the poses ``(n, 7)`` of all.
        rng: Random numbers, for points in random order.
    """

    targets: Sequence[Target]
    members: Sequence[int]
    pictures: Sequence[ColourView]
    cloud: ColouredCloud
    boxes: Sequence[Obstacle]
    places: Callable[[int, Array], Sequence[PlaceModel]]
    rng: np.random.Generator
    _tried: dict[tuple[Any, ...], Fit | None] = field(default_factory=dict, init=False, repr=False)

    def track(self, wanted: Iterable[int], believed: Array, held: Collection[int]) -> dict[int, Sight]:
        """Those that are where they were believed to be, poses ``(n, 7)``, in the hand or at rest.

        What is seen near several of them belongs to the nearest.
        """
        there = [i for i in self.members if np.isfinite(believed[i, 0])]
        if not there:
            return {}
        gaps = np.array([self._gaps(i, believed[i]) for i in there])
        found = {}
        for i in set(wanted) & set(there):
            gap = gaps[there.index(i)]
            own = (gap < WITHIN) & (gap <= np.min(gaps, axis=0))
            views = self._views(i, own)
            near, places = follow if i in held else stay, self.places(i, believed)
            fits = [near(self.targets[i], view, believed[i], places) for view in views]
            best = self._best(i, fits, views)
            if best is None:
                continue
            if still_held(best, believed[i]) if i in held else best.cost < FAIR:
                found[i] = Sight(best, own)
        return found

    def hidden(self, i: int, believed: Array) -> bool:
        """Whether no camera sees that an object is gone from a pose ``(7,)``."""
        points = sample_surface(self.targets[i].shape)
        nothing = np.empty((0, 3))
        views = [DepthView(camera, depth, nothing, others) for camera, depth, others in self.pictures]
        return all(seen_through(points, view, believed) < GONE for view in views)

    def find(
        self,
        wanted: Iterable[int],
        estimate: Array,
        given: Mapping[int, Sight],
        stages: Sequence[FitStage] = STAGES,
    ) -> dict[int, Sight]:
        """Those that can be found.

        Args:
            wanted: The objects' numbers.
            estimate: Poses ``(n, 7)`` of all, as far as they are known.
            given: Those of the colour that were found already; what they explain is theirs.
            stages: How they are looked for, one after the other.
        """
        found, estimate, left = dict(given), estimate.copy(), list(stages)
        rest = sorted(set(wanted) - set(found))
        while rest and left:
            parts = self.cloud.parts(~self._explained(found), SMALLEST)
            new = self._assigned(rest, parts, estimate, left[0])
            if not new:
                del left[0]
                continue
            left = list(stages)  # others may be seen for themselves now, or known to stand on it
            found |= new
            for i, sight in new.items():
                estimate[i] = sight.fit.pose
            rest = [i for i in rest if i not in found]
        return {i: sight for i, sight in found.items() if i not in given}

    def alike(
        self, pairs: Iterable[tuple[int, int]], found: Mapping[int, Sight], estimate: Array
    ) -> list[tuple[int, int]]:
        """Those of some pairs of which the pictures do not say which is which.

        Args:
            pairs: Numbers of objects.
            found: Those that were found.
            estimate: Poses ``(n, 7)`` of all, as far as they are known.
        """
        return [pair for pair in pairs if self._margin(*pair, found, estimate) < SURE]

    def _margin(self, a: int, b: int, found: Mapping[int, Sight], estimate: Array) -> float:
        """Cost by which the pictures are explained worse with two objects exchanged."""
        extents = [sorted(self.targets[i].model.extent) for i in (a, b)]
        seen = [(i, k) for i, k in ((a, b), (b, a)) if i in found]
        if not seen or max(abs(x - y) for x, y in zip(*extents, strict=True)) > SIMILAR:
            return np.inf
        more = pixels = 0.0
        for i, instead in seen:
            fit, own = found[i]
            other = self._fit(instead, own, estimate, FitStage(True, False, POOR), fit.pose)
            n = int(np.count_nonzero(own))
            more, pixels = more + n * ((1.0 if other is None else other.cost) - fit.cost), pixels + n
        return more / pixels

    def _assigned(
        self, rest: Sequence[int], parts: Sequence[Array], estimate: Array, stage: FitStage
    ) -> dict[int, Sight]:
        """The assignment of objects to parts that explains most."""
        fits: dict[tuple[int, int], Sight] = {}
        worth = np.zeros((len(rest), len(parts)))
        for row, i in enumerate(rest):
            for column, part in enumerate(parts):
                if not self._may_be(i, part, stage):
                    continue
                tried = self._lowest(i, part) if stage.pieces else part
                fit = self._fit(i, tried, estimate, stage)
                if fit is None:
                    continue
                own = tried & (self._gaps(i, fit.pose) < WITHIN)
                if stage.pieces:
                    fit = self._fit_to(i, own, fit.pose, estimate)
                if fit is not None and fit.cost < stage.limit:
                    fits[row, column] = Sight(fit, own)
                    # By the whole part: of a stack it is not the larger one that counts, but what fits.
                    worth[row, column] = np.count_nonzero(part) * (1.0 - fit.cost)
        return {rest[row]: fits[row, column] for row, column in matched(worth) if (row, column) in fits}

    def _may_be(self, i: int, part: Array, stage: FitStage) -> bool:
        """Whether a part's size is an object's, or that of several together."""
        points = self.cloud.smooth[part]
        across = float(np.linalg.norm(np.max(points, axis=0) - np.min(points, axis=0)))
        size = self.targets[i].diameter
        return across > SMALL * size and (stage.pieces or across < 1.2 * size + MARGIN)

    def _lowest(self, i: int, part: Array) -> Array:
        """What of a part is no higher above its foot than an object: others may stand on it."""
        height = self.cloud.smooth[:, 2]
        lowest: Array = part & (height < np.min(height[part]) + self.targets[i].model.extent[2] - FOOT)
        return lowest

    def _fit(
        self, i: int, part: Array, estimate: Array, stage: FitStage, before: Array | None = None
    ) -> Fit | None:
        """The best fit of an object to a part."""
        places = self.places(i, estimate)
        key = (i, stage.free, part.tobytes(), *(place.pose.tobytes() for place in places))
        if before is None and key in self._tried:
            return self._tried[key]
        target, views = self.targets[i], self._views(i, part)
        points = sample_surface(target.shape)
        fits = [stand_on(target, view, places, points, before) for view in views]
        best = self._best(i, fits, views)
        if stage.free and (best is None or best.cost >= FAIR):
            lying = self._best(i, [lie_about(target, v, places, points, before) for v in views], views)
            best = min(filter(None, (best, lying)), key=lambda fit: fit.cost, default=None)
        if before is None:
            self._tried[key] = best
        return best

    def _fit_to(self, i: int, own: Array, start: Array, estimate: Array) -> Fit | None:
        """The best fit near a pose to some points."""
        views = self._views(i, own)
        fits = [stay(self.targets[i], view, start, self.places(i, estimate)) for view in views]
        return self._best(i, fits, views)

    def _best(self, i: int, fits: Iterable[Fit | None], views: Sequence[DepthView]) -> Fit | None:
        """The fit that explains all views best, judged in all."""
        points = sample_surface(self.targets[i].shape)
        tried = [fit.pose for fit in fits if fit is not None]
        tried += [mean for a, b in combinations(tried, 2) if (mean := between(a, b)) is not None]
        weights = [len(view.points) for view in views]
        judged = [joint([judge_fit(points, view, pose) for view in views], weights) for pose in tried]
        return min(judged, key=lambda fit: fit.cost, default=None)

    def _views(self, i: int, part: Array) -> list[DepthView]:
        """What cameras show of a part, where they show enough."""
        found = []
        for k, (camera, depth, others) in enumerate(self.pictures):
            points = self.cloud.points[part & (self.cloud.camera == k)]
            if len(points) < SMALLEST:
                continue
            near = boxes_near(self.boxes, np.median(points, axis=0), self.targets[i].diameter)
            found.append(DepthView(camera, depth, self.rng.permutation(points), others, near))
        return found

    def _explained(self, found: Mapping[int, Sight]) -> Array:
        """Points ``(n,)`` of the cloud that objects explain."""
        explained: Array = np.zeros(len(self.cloud.points), bool)
        for i, sight in found.items():
            explained |= self._gaps(i, sight.fit.pose) < OWN
        return explained

    def _gaps(self, i: int, pose: Array) -> Array:
        """Metres ``(n,)`` from an object's surface to the points of the cloud, about."""
        local = poses.transform(poses.inverse(pose), self.cloud.smooth)
        gaps: Array = _tree(self.targets[i].shape).query(local, distance_upper_bound=2 * WITHIN)[0]
        return gaps


def joint(fits: Sequence[Fit], weights: Sequence[float]) -> Fit:
    """How well one pose explains several pictures, each by its weight."""
    values = np.average([fit[1:] for fit in map(_numbers, fits)], axis=0, weights=weights)
    return Fit(fits[0].pose, *map(float, values))


def between(a: Array, b: Array) -> Array | None:
    """The pose ``(7,)`` half-way between two that agree; None where they do not."""
    if float(poses.angle_between(a[3:], b[3:])) > AGREE:
        return None
    same = b[3:] if float(a[3:] @ b[3:]) > 0.0 else -b[3:]
    return np.concatenate([(a[:3] + b[:3]) / 2, poses.normalise(a[3:] + same)])


def matched(worth: Array) -> list[tuple[int, int]]:
    """Pairs of a row and a column, each at most once, whose ``worth (r, c)`` together is the largest."""
    rows, columns = linear_sum_assignment(worth, maximize=True)
    return [(int(r), int(c)) for r, c in zip(rows, columns, strict=True) if worth[r, c] > 0.0]


def group_of(
    targets: Sequence[Target],
    members: Sequence[int],
    pictures: Sequence[ColourView],
    masks: Sequence[Array],
    boxes: Sequence[Obstacle],
    places: Callable[[int, Array], Sequence[PlaceModel]],
    rng: np.random.Generator,
) -> SameColour:
    """The objects of one colour, given what shows it: masks ``(height, width)``, one for each picture."""
    cameras, depths = [p.camera for p in pictures], [p.depth for p in pictures]
    cloud = coloured_cloud(cameras, depths, masks, boxes)
    return SameColour(targets, members, pictures, cloud, boxes, places, rng)


def pairs_of(numbers: Collection[int]) -> list[tuple[int, int]]:
    """All pairs of some numbers."""
    return list(combinations(sorted(numbers), 2))


def _numbers(fit: Fit) -> tuple[Array, float, float, float]:
    return fit.pose, fit.distance, fit.missing, fit.overlap


@lru_cache(maxsize=256)
def _tree(shape: Shape) -> cKDTree:
    return cKDTree(sample_surface(shape).points)
