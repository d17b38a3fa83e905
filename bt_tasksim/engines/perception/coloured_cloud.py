"""All that cameras see in one colour, as points, and which of them hang together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Obstacle
from bt_tasksim.engines.cameras import unproject
from bt_tasksim.engines.images import CameraModel
from bt_tasksim.engines.perception.segmentation import outside

TOGETHER = 0.006
"""Metres between smoothed points up to which they hang together: less than the gaps between things that
stand, more than what two cameras' calibration differs by."""
CELL = 0.003
"""Edge in metres of the cells in which points count as one, when it is asked what hangs together."""
FLAT = 0.010
"""Metres of depth within which a pixel's neighbours show the same surface."""


@dataclass(frozen=True, eq=False)
class ColouredCloud:
    """The points of one colour in all pictures, robot base frame.

    Attributes:
        points: ``(n, 3)`` metres, as they are seen.
        smooth: ``(n, 3)`` likewise, each averaged with its neighbours on the same surface.
        camera: ``(n,)`` index of the camera.
        pixels: ``(n, 2)`` row and column there.
    """

    points: Array
    smooth: Array
    camera: Array
    pixels: Array

    def parts(self, chosen: Array, smallest: int) -> list[Array]:
        """Which of the chosen points ``(n,)`` hang together: masks ``(n,)``, the largest first.

        Args:
            chosen: Boolean.
            smallest: Pixels that some camera shows of a part at least.
        """
        where = np.flatnonzero(chosen)
        if not len(where):
            return []
        label = hanging_together(self.smooth[where])
        found = []
        for number in range(int(label.max()) + 1):
            part = np.zeros(len(chosen), bool)
            part[where[label == number]] = True
            if np.bincount(self.camera[part]).max() >= smallest:
                found.append(part)
        return sorted(found, key=lambda part: -int(np.count_nonzero(part)))


def coloured_cloud(
    cameras: Sequence[CameraModel],
    depths: Sequence[Array],
    masks: Sequence[Array],
    boxes: Sequence[Obstacle],
    margin: float = 0.006,
) -> ColouredCloud:
    """The points of one colour.

    Args:
        cameras: The cameras.
        depths: Their pictures ``(height, width)`` in metres; 0 where nothing was seen.
        masks: ``(height, width)`` boolean: what has the colour there.
        boxes: Fixtures.
        margin: Metres around a fixture that count as the fixture.
    """
    points, smooth, number, pixels = [], [], [], []
    for k, (camera, depth, mask) in enumerate(zip(cameras, depths, masks, strict=True)):
        rows, columns = np.nonzero(mask & (depth > 0))
        seen = unproject(camera, rows, columns, depth[rows, columns])
        free = outside(seen, boxes, margin)
        rows, columns = rows[free], columns[free]
        points.append(seen[free])
        smooth.append(unproject(camera, rows, columns, _smoothed(depth, mask, rows, columns)))
        number.append(np.full(len(rows), k))
        pixels.append(np.stack([rows, columns], axis=-1))
    return ColouredCloud(*(np.concatenate(each) for each in (points, smooth, number, pixels)))


def hanging_together(points: Array) -> Array:
    """A number ``(n,)`` for each of some points ``(n, 3)``: equal where a chain of near ones leads over."""
    _, inverse, count = np.unique(
        np.floor(points / CELL).astype(int), axis=0, return_inverse=True, return_counts=True
    )
    inverse = inverse.reshape(-1)
    middle = np.stack([np.bincount(inverse, points[:, k]) for k in range(3)], axis=-1) / count[:, None]
    pairs = cKDTree(middle).query_pairs(TOGETHER, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(middle),) * 2)
    _, label = connected_components(links, directed=False)
    found: Array = label[inverse]
    return found


def _smoothed(depth: Array, mask: Array, rows: Array, columns: Array) -> Array:
    """Depth ``(n,)`` at pixels, averaged over neighbours of the mask that show the same surface."""
    height, width = depth.shape
    own = depth[rows, columns]
    total, count = np.zeros(len(rows)), np.zeros(len(rows))
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            r, c = np.clip(rows + down, 0, height - 1), np.clip(columns + right, 0, width - 1)
            near = depth[r, c]
            same = mask[r, c] & (near > 0) & (abs(near - own) < FLAT)
            total += np.where(same, near, 0.0)
            count += same
    smooth: Array = total / np.maximum(count, 1.0)
    return smooth
