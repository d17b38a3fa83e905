"""Holes between the boxes that something is made of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.box import Box

EDGE = 1e-6
"""Metres by which edges of boxes that are said to be the same may differ."""


class BoxHole(NamedTuple):
    """A hole.

    Attributes:
        pose: Pose ``(7,)`` of the middle of its end in the frame of the boxes; z points out of it.
        extent: Full size ``(2,)`` along x and y, metres.
        depth: How deep it is, metres.
    """

    pose: Array
    extent: tuple[float, float]
    depth: float


def opening(boxes: Sequence[Box], along: Array, owner: str) -> BoxHole:
    """The hole that boxes have along a line, from one of their sides to the other or as far as it goes.

    Args:
        boxes: The boxes, all turned alike.
        along: Direction ``(3,)`` into the hole, along an axis of the boxes.
        owner: Whose they are, for the error's sentence.

    Raises:
        InputError: There is none.
    """
    inward = np.asarray(along, float)
    k = int(abs(inward).argmax())
    across = [i for i in range(3) if i != k]
    low = np.array([np.array(box.pose[:3]) - _half(box) for box in boxes])
    high = np.array([np.array(box.pose[:3]) + _half(box) for box in boxes])
    edges = [_edges(np.concatenate([low[:, i], high[:, i]])) for i in across]
    filled = np.zeros([len(e) - 1 for e in edges], bool)
    for a, b in zip(low[:, across], high[:, across], strict=True):
        cells = [(e[:-1] > p - EDGE) & (e[1:] < q + EDGE) for e, p, q in zip(edges, a, b, strict=True)]
        filled |= np.outer(*cells)
    inside = np.argwhere(_enclosed(~filled))
    if not len(inside):
        raise InputError(f"{owner} has no hole along {tuple(inward.tolist())}: look at its collision shapes")
    first = [float(edges[i][inside[:, i].min()]) for i in (0, 1)]
    last = [float(edges[i][inside[:, i].max() + 1]) for i in (0, 1)]
    ends = (float(low[:, k].min()), float(high[:, k].max()))
    centre = np.zeros(3)
    centre[across] = (np.array(first) + last) / 2
    centre[k] = ends[1] if inward[k] > 0.0 else ends[0]
    axes = np.zeros((3, 3))  # columns: the hole's x, y and z
    axes[across[0], 0] = 1.0
    axes[k, 2] = -np.sign(inward[k])
    axes[:, 1] = np.cross(axes[:, 2], axes[:, 0])
    size = (last[0] - first[0], last[1] - first[1])
    return BoxHole(poses.pose(centre, poses.from_matrix(axes)), size, ends[1] - ends[0])


def _half(box: Box) -> Array:
    """Half size ``(3,)`` of a box along the axes of its frame's frame."""
    half: Array = abs(poses.to_matrix(np.array(box.pose[3:]))) @ np.array(box.size) / 2
    return half


def _edges(values: Array) -> NDArray[np.float64]:
    """Different ones of some coordinates, in order."""
    ordered = np.sort(values)
    found: NDArray[np.float64] = ordered[np.concatenate([[True], np.diff(ordered) > EDGE])]
    return found


def _enclosed(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Those of some cells from which nothing leads out over an edge."""
    out = np.zeros([n + 2 for n in free.shape], bool)
    out[0], out[-1], out[:, 0], out[:, -1] = True, True, True, True
    room = np.ones(out.shape, bool)
    room[1:-1, 1:-1] = free
    while True:
        wider = out.copy()
        wider[1:] |= out[:-1]
        wider[:-1] |= out[1:]
        wider[:, 1:] |= out[:, :-1]
        wider[:, :-1] |= out[:, 1:]
        wider &= room
        if (wider == out).all():
            return free & ~out[1:-1, 1:-1]
        out = wider
