"""Which pixels of an RGB-D image belong to which object.

A pixel is an object's when its colour is nearer to the object's known colour than to any other colour that
is known to be in the scene, and its point lies outside every known fixture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from bt_tasksim import poses
from bt_tasksim.engines.cameras import unproject
from bt_tasksim.engines.pipeline import CameraModel
from bt_tasksim.poses import Array
from bt_tasksim.world import Obstacle

NEUTRAL = (1.0, 1.0, 1.0)
"""The colour of robots, walls and highlights: any grey."""
WIDEST_ANGLE = np.deg2rad(16.0)
"""Angle between a pixel's colour and an object's beyond which the pixel is never the object's."""
DARKEST = 0.004
"""Linear brightness below which a pixel has no colour to speak of."""

_LINEAR = (np.arange(256) / 255.0) ** 2.2


@dataclass(frozen=True)
class Segment:
    """A connected part of an image that shows one object.

    Attributes:
        mask: ``(height, width)`` boolean.
        points: ``(n, 3)`` metres, robot base frame, of its pixels.
    """

    mask: Array
    points: Array

    @property
    def pixels(self) -> int:
        """How many pixels it has."""
        return len(self.points)


def colour_angles(image: Array, colours: Array) -> Array:
    """Angles ``(height, width, k)`` in radians between the pixels' colours and given ones, in linear RGB.

    Shading scales a colour and leaves its direction: the spectral angle of Kruse et al., "The spectral image
    processing system (SIPS)", Remote Sensing of Environment 44 (1993).

    Args:
        image: ``(height, width, 3)`` uint8, sRGB.
        colours: ``(k, 3)`` sRGB, 0 to 1.
    """
    linear = _LINEAR[image]
    length = np.linalg.norm(linear, axis=-1, keepdims=True)
    wanted = np.asarray(colours, float) ** 2.2
    wanted = wanted / np.maximum(np.linalg.norm(wanted, axis=-1, keepdims=True), 1e-9)
    cosine = linear / np.maximum(length, 1e-9) @ wanted.T
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    return np.where(length > DARKEST, angle, np.pi)


def classify(image: Array, colours: Sequence[tuple[float, float, float]], others: Array) -> list[Array]:
    """Masks ``(height, width)``, one for each object's colour.

    Args:
        image: ``(height, width, 3)`` uint8, sRGB.
        colours: The objects' colours, sRGB, 0 to 1; equal ones get equal masks.
        others: Colours ``(k, 3)`` of everything else; those that look like an object's do not count.
    """
    wanted = np.asarray(colours, float).reshape(-1, 3)
    own = colour_angles(image, wanted)
    rivals = np.full(image.shape[:2], np.pi)
    swatch = np.round(255 * np.asarray(others, float).reshape(1, -1, 3)).astype(np.uint8)
    distinct = np.all(colour_angles(swatch, wanted)[0] > np.deg2rad(5.0), axis=-1)
    if np.any(distinct):
        rivals = np.min(colour_angles(image, np.asarray(others, float)[distinct]), axis=-1)
    nearest = np.min(own, axis=-1)
    return [
        (own[..., i] <= nearest + 1e-9) & (own[..., i] < rivals) & (own[..., i] < WIDEST_ANGLE)
        for i in range(len(wanted))
    ]


def outside(points: Array, boxes: Sequence[Obstacle], margin: float) -> Array:
    """Boolean ``(n,)``: points ``(n, 3)`` that are farther than ``margin`` metres from every box."""
    out = np.ones(len(points), bool)
    for box in boxes:
        local = poses.transform(poses.inverse(box.pose), points)
        gap = np.maximum(np.abs(local) - np.array(box.size) / 2, 0.0)
        out &= np.sum(gap * gap, axis=-1) > margin * margin
    return out


def find_segments(
    camera: CameraModel,
    depth: Array,
    mask: Array,
    boxes: Sequence[Obstacle],
    *,
    size: float,
    margin: float = 0.006,
    smallest: int = 30,
) -> list[Segment]:
    """Candidate segments of one object, largest first.

    Args:
        camera: The camera.
        depth: ``(height, width)`` metres; 0 where nothing was seen.
        mask: ``(height, width)`` boolean, pixels of the object's colour.
        boxes: Fixtures.
        size: The object's largest diameter, metres: pieces of one colour within it (a finger may part what
            is seen) count as one.
        margin: Metres around a fixture that count as the fixture.
        smallest: Pixels that a segment has at least.
    """
    rows, columns = np.nonzero(mask & (depth > 0))
    if len(rows) < smallest:
        return []
    points = unproject(camera, depth)
    kept = np.zeros(mask.shape, np.uint8)
    free = outside(points[rows, columns], boxes, margin)
    kept[rows[free], columns[free]] = 1
    count, labels, stats, _ = cv2.connectedComponentsWithStats(kept, connectivity=8)
    order = sorted(range(1, count), key=lambda k: -int(stats[k, cv2.CC_STAT_AREA]))
    order = [k for k in order if stats[k, cv2.CC_STAT_AREA] >= max(3, smallest // 10)]
    middles = {k: np.median(points[labels == k], axis=0) for k in order[:12]}
    segments, used = [], set()
    for k in middles:
        if k in used:
            continue
        parts = [
            j for j in middles if j not in used and np.linalg.norm(middles[j] - middles[k]) < 0.75 * size
        ]
        used.update(parts)
        region = _without_stragglers(np.isin(labels, parts), points, middles[k], size)
        if np.count_nonzero(region) >= smallest:
            segments.append(Segment(region, points[region]))
    return sorted(segments, key=lambda s: -s.pixels)


def _without_stragglers(mask: Array, points: Array, middle: Array, size: float) -> Array:
    """The mask without points that are farther from the middle than the object is large."""
    gap = points - middle
    near: Array = mask & (np.sum(gap * gap, axis=-1) < size * size)
    return near
