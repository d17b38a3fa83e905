"""How far a part of furniture is open, as depth images show it.

Its joint is calibrated, so one number is looked for. Samples of the part's surface are put where each value
would have them: those that face a camera either lie where it sees something, or it sees past them to what is
behind, or something else stands before them, which says nothing. The value counts that explains most.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.joints import Joints
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.cameras import project
from bt_tasksim.engines.images import CameraModel
from bt_tasksim.engines.perception.registration import SEE_THROUGH, ModelPoints

NEAR = 0.005
"""Metres of depth by which a sample is about as good as wrong."""
FACING = 0.25
"""Cosine of the angle between a sample's normal and the way to the camera from which the camera sees it."""
STEPS, ROUNDS, SHARPER = 33, 3, 8.0
"""Values that are tried over the range, how often again about the best one, and how much closer together."""
LEAST = 40
"""Samples that have to be where something is seen."""
ALIKE = 0.9
"""Share of the most that is explained from which the part may be there as well."""


class SeenPart(NamedTuple):
    """What images say of a part: how far it is open, and which camera showed most of it."""

    value: float
    camera: str
    explained: float


@dataclass(frozen=True, eq=False)
class PartView:
    """A picture in which a part is looked for: the camera, and the depth ``(height, width)`` in metres."""

    camera: CameraModel
    depth: Array


def seen_part(joints: Joints, surface: ModelPoints, pictures: Mapping[str, PartView]) -> SeenPart | None:
    """How far a part is open.

    Args:
        joints: Its joint ``(1,)``.
        surface: Samples of its surface, in its frame.
        pictures: By camera.

    Returns:
        What was seen, or None where too little of it was to say.
    """
    low, high = (float(limit) for limit in joints.limits[0])
    step = (high - low) / (STEPS - 1)
    values = low + step * np.arange(STEPS)
    best = low
    for _ in range(ROUNDS):
        best = _middle(values, [float(_worth(joints, surface, pictures, v).sum()) for v in values])
        step /= SHARPER
        values = np.clip(best + step * np.arange(-SHARPER, SHARPER + 1), low, high)
    shown = _worth(joints, surface, pictures, best)
    if shown.sum() < LEAST:
        return None
    return SeenPart(best, list(pictures)[int(np.argmax(shown))], float(shown.sum()))


def _middle(values: Array, worth: Sequence[float]) -> float:
    """The middle of the values about the best one that explain nearly as much."""
    first = last = int(np.argmax(worth))
    enough = max(ALIKE * worth[first], 1e-9)
    while first > 0 and worth[first - 1] >= enough:
        first -= 1
    while last < len(worth) - 1 and worth[last + 1] >= enough:
        last += 1
    return float(values[first] + values[last]) / 2


def _worth(joints: Joints, surface: ModelPoints, pictures: Mapping[str, PartView], value: float) -> Array:
    """For each picture, samples that are where something is seen, less those that cannot be there."""
    pose = joints.pose(np.array([value]))[0]
    points, normals = poses.transform(pose, surface.points), poses.rotate(pose[3:], surface.normals)
    found = []
    for camera, depth in ((view.camera, view.depth) for view in pictures.values()):
        away = camera.pose[:3] - points
        facing = np.einsum("ij,ij->i", away, normals) > FACING * np.linalg.norm(away, axis=-1)
        pixel, far = project(camera, points[facing])
        column, row = (pixel // 1).astype(int).T
        inside = (far > 0) & (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
        there = depth[row[inside], column[inside]]
        gap = np.where(there > 0, there - far[inside], -1.0)
        found.append(np.exp(-((gap / NEAR) ** 2)).sum() - np.count_nonzero(gap > SEE_THROUGH))
    return np.array(found)
