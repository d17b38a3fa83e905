"""Which pixels of an RGB-D image belong to which object.

A pixel is an object's when its colour is nearer to the object's known colour than to any other colour that
is known to be in the scene, and its point lies outside every known fixture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import cv2
import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Obstacle
from bt_tasksim.engines.cameras import unproject
from bt_tasksim.engines.images import CameraModel

NEUTRAL = (1.0, 1.0, 1.0)
"""The colour of robots, walls and highlights: any grey."""
WIDEST_ANGLE = np.deg2rad(16.0)
"""Angle between a pixel's colour and an object's beyond which the pixel is never the object's."""
SMALLEST = 30
"""Pixels that an object must show to be seen."""
DARKEST = 0.004
"""Linear brightness below which a pixel has no colour to speak of."""

TWINS = np.deg2rad(5.0)
"""Angle between two colours that cannot be told apart."""

_LINEAR = ((np.arange(256) / 255.0) ** 2.2).astype(np.float32)


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


def colour_cosines(image: Array, colours: Array) -> Array:
    """Cosines ``(height, width, k)`` of the angles between the pixels' colours and given ones, in linear RGB.

    Shading scales a colour and leaves its direction: the spectral angle of Kruse et al., "The spectral image
    processing system (SIPS)", Remote Sensing of Environment 44 (1993). Black pixels give -1.

    Args:
        image: ``(height, width, 3)`` uint8, sRGB.
        colours: ``(k, 3)`` sRGB, 0 to 1.
    """
    linear = cv2.LUT(np.ascontiguousarray(image), _LINEAR)
    length = np.sqrt(np.einsum("ijk,ijk->ij", linear, linear))[..., None]
    wanted = (np.asarray(colours, float) ** 2.2).astype(np.float32)
    wanted = wanted / np.maximum(np.linalg.norm(wanted, axis=-1, keepdims=True), 1e-9)
    cosine = linear @ wanted.T / np.maximum(length, 1e-9)
    return np.where(length > DARKEST, cosine, -1.0)


def classify(image: Array, colours: Sequence[tuple[float, float, float]], others: Array) -> list[Array]:
    """Masks ``(height, width)``, one for each object's colour.

    Args:
        image: ``(height, width, 3)`` uint8, sRGB.
        colours: The objects' colours, sRGB, 0 to 1; equal ones get equal masks.
        others: Colours ``(k, 3)`` of everything else; those that look like an object's do not count.
    """
    wanted = np.asarray(colours, float).reshape(-1, 3)
    others = np.asarray(others, float).reshape(-1, 3)
    swatch = np.round(255 * others[None]).astype(np.uint8)
    distinct = np.all(colour_cosines(swatch, wanted)[0] < np.cos(TWINS), axis=-1)
    cosine = colour_cosines(image, np.concatenate([wanted, others[distinct]]))
    each = np.ascontiguousarray(np.moveaxis(cosine, -1, 0))  # NumPy reduces along a short last axis slowly
    best = np.max(each, axis=0) - 1e-6
    return [(each[i] >= best) & (each[i] > np.cos(WIDEST_ANGLE)) for i in range(len(wanted))]


def groups_of_colour(colours: Sequence[tuple[float, float, float]]) -> list[list[int]]:
    """Numbers of the colours (sRGB, 0 to 1), each with those that cannot be told from it."""
    wanted = np.asarray(colours, float).reshape(-1, 3)
    if not len(wanted):
        return []
    cosine = colour_cosines(np.round(255 * wanted[None]).astype(np.uint8), wanted)[0]
    groups: list[list[int]] = []
    for i in range(len(wanted)):
        near = [group for group in groups if np.any(cosine[i, group] > np.cos(TWINS))]
        groups = [group for group in groups if group not in near] + [sorted([i, *chain(*near)])]
    return groups


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
    smallest: int = SMALLEST,
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
    points = unproject(camera, rows, columns, depth[rows, columns])
    free = outside(points, boxes, margin)
    rows, columns, points = rows[free], columns[free], points[free]
    kept = np.zeros(mask.shape, np.uint8)
    kept[rows, columns] = 1
    _, labels, stats, _ = cv2.connectedComponentsWithStats(kept, connectivity=8)
    label, area = labels[rows, columns], stats[:, cv2.CC_STAT_AREA]
    order = [
        int(k) for k in 1 + np.argsort(-area[1:], kind="stable")[:12] if area[k] >= max(3, smallest // 10)
    ]
    middles = {k: np.median(points[label == k], axis=0) for k in order}
    segments: list[Segment] = []
    used: set[int] = set()
    for k in order:
        if k in used:
            continue
        near = [j for j in order if np.linalg.norm(middles[j] - middles[k]) < 0.75 * size]
        parts = [j for j in near if j not in used]
        used.update(parts)
        gap = points - middles[k]
        chosen = np.isin(label, parts) & (np.sum(gap * gap, axis=-1) < size * size)
        if np.count_nonzero(chosen) >= smallest:
            region = np.zeros(mask.shape, bool)
            region[rows[chosen], columns[chosen]] = True
            segments.append(Segment(region, points[chosen]))
    return sorted(segments, key=lambda s: -s.pixels)
