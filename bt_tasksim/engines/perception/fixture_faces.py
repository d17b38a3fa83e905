"""What known fixtures say about where an object can be: nothing reaches through a face that it is before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Obstacle


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes of fixtures, robot base frame.

    Attributes:
        middles: ``(b, 3)`` metres.
        matrices: ``(b, 3, 3)``, their axes as columns.
        half: ``(b, 3)`` half their sizes, metres.
    """

    middles: Array
    matrices: Array
    half: Array


def boxes_near(boxes: Sequence[Obstacle], point: Array, reach: float) -> Boxes | None:
    """Those that are no farther than ``reach`` metres from a point ``(3,)``; None where there is none."""
    found = []
    for box in boxes:
        middle, half = np.array(box.pose[:3], float), np.array(box.size) / 2
        matrix = poses.to_matrix(np.array(box.pose[3:], float))
        gap = np.maximum(abs(matrix.T @ (point - middle)) - half, 0.0)
        if float(np.linalg.norm(gap)) < reach:
            found.append((middle, matrix, half))
    return Boxes(*map(np.array, zip(*found, strict=True))) if found else None


def beyond_faces(boxes: Boxes, points: Array, middle: Array) -> tuple[Array, Array]:
    """How far an object's points reach through faces that its middle is before.

    A wall may be thin: a point behind it is as wrong as one in it.

    Args:
        boxes: The boxes.
        points: Points ``(n, 3)`` of the object, robot base frame.
        middle: Its middle ``(3,)``.

    Returns:
        For each point metres ``(n,)`` behind a face, 0 before all of them; and the face's normal ``(n, 3)``.
    """
    local = np.einsum("bij,bni->bnj", boxes.matrices, points[None] - boxes.middles[:, None])
    where = np.einsum("bij,bi->bj", boxes.matrices, middle - boxes.middles)
    axis = np.argmax(abs(where) - boxes.half, axis=-1)
    each = np.arange(len(axis))
    side = np.where(where[each, axis] < 0.0, -1.0, 1.0)
    behind = boxes.half[each, axis][:, None] - side[:, None] * local[each, :, axis]
    within = abs(local) < boxes.half[:, None]
    within[each, :, axis] = True
    depth = np.where(np.all(within, axis=-1), np.maximum(behind, 0.0), 0.0)
    deepest = np.argmax(depth, axis=0)
    normals = side[:, None] * boxes.matrices[each, :, axis]
    return depth[deepest, np.arange(len(points))], normals[deepest]
