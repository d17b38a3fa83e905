"""Fitting a known shape to the points of a depth image, seen from one side.

Point-to-plane iterative closest points: Y. Chen and G. Medioni, "Object modelling by registration of multiple
range images", Image and Vision Computing 10 (1992). Only the model's points that face the camera take part,
so the side that nobody sees does not pull; weights are Cauchy's, so that stray points hardly count.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.cameras import project
from bt_tasksim.engines.images import CameraModel
from bt_tasksim.engines.perception.fixture_faces import Boxes, beyond_faces
from bt_tasksim.scene.shapes import Shape

UPRIGHT = (0, 1, 5)
"""Free motions of a thing that stands on a plane: x, y, rotation about z."""
FREE = (0, 1, 2, 3, 4, 5)
"""All motions: x, y, z, and rotations about x, y, z of the robot base frame."""
SEE_THROUGH = 0.012
"""Metres by which something behind the model is seen in its place before the model is in doubt."""
FAR = 0.010
"""Metres from the model at which a point counts as not explained at all."""
NEARLY = 0.003
"""Metres by which a model may seem to reach into a fixture: errors of the camera's calibration and depth."""
FIRM = 10.0
"""Weight of what reaches into a fixture, over that of what is seen: where a twentieth of the model is 2 mm
too deep it pulls as what is seen does at 1 mm."""
ANCHOR = 0.01
"""Weight of what was believed before, over that of what is seen: the error that a whole picture has in common
(1 mm) over that of the belief (10 mm, or 19 degrees at `LEVER`), squared. With 0.1 what turns in the hand was
followed too slowly, and lost."""
LEVER = 0.03
"""Metres by which a rotation counts as a motion."""


@dataclass(frozen=True, eq=False)
class ModelPoints:
    """Points ``(n, 3)`` on a shape's visible surface and unit normals ``(n, 3)`` there, object's frame.

    ``area`` is that of the whole surface in square metres.
    """

    points: Array
    normals: Array
    area: float

    @property
    def spacing(self) -> float:
        """Distance between neighbouring points, about, in metres."""
        return math.sqrt(self.area / max(len(self.points), 1))

    def thinned(self, n: int) -> ModelPoints:
        """The first ``n`` of them; they lie in random order."""
        return ModelPoints(self.points[:n], self.normals[:n], self.area)


@dataclass(frozen=True, eq=False)
class DepthView:
    """What is known of one object from one image.

    Attributes:
        camera: The camera.
        depth: ``(height, width)`` metres, of everything.
        points: ``(n, 3)`` the object's points, robot base frame, in random order.
        others: ``(height, width)`` boolean: pixels that show another known object or are not to be judged.
        fixtures: Boxes of fixtures near it, if any.
    """

    camera: CameraModel
    depth: Array
    points: Array
    others: Array | None = None
    fixtures: Boxes | None = None

    def thinned(self, n: int) -> DepthView:
        """With at most ``n`` points."""
        return replace(self, points=self.points[:n])


@dataclass(frozen=True, eq=False)
class Fit:
    """A pose and how well it explains an image.

    Attributes:
        pose: ``(7,)`` robot base frame.
        distance: Mean distance of the points to the model, each counted as `FAR` at most; metres.
        missing: Share of the model's facing points in whose place something behind is seen, 0 to 1.
        overlap: Mean depth of the model's points in fixtures, each counted as `FAR` at most; metres.
    """

    pose: Array
    distance: float
    missing: float
    overlap: float = 0.0

    @property
    def cost(self) -> float:
        """0 for a perfect fit, about 1 where nothing fits."""
        return (self.distance + self.overlap) / FAR + self.missing


@lru_cache(maxsize=256)
def sample_surface(shape: Shape, n: int = 3000) -> ModelPoints:
    """Points spread evenly over what is seen of a shape; the same ones at every call."""
    mesh = shape.visual
    corners = mesh.vertices[mesh.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=-1)
    rng = np.random.default_rng(0)
    # Evenly spaced along the summed area, then shuffled: less clustered than independent draws.
    along = (np.arange(n) + rng.uniform(0, 1, n)) / n * np.sum(area)
    which = np.minimum(np.searchsorted(np.cumsum(area), along), len(area) - 1)
    rng.shuffle(which)
    u, v = rng.uniform(0, 1, (2, n, 1))
    flip = u + v > 1
    u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
    c = corners[which]
    points = c[:, 0] + u * (c[:, 1] - c[:, 0]) + v * (c[:, 2] - c[:, 0])
    return ModelPoints(points, normal[which] / area[which][:, None], float(np.sum(area)) / 2)


def register(
    model: ModelPoints,
    view: DepthView,
    start: Array,
    free: Sequence[int],
    *,
    steps: int = 20,
    reach: tuple[float, float] = (0.02, 0.003),
    anchored: bool = False,
) -> Array:
    """The pose ``(7,)`` near ``start`` at which the model fits the points best.

    Args:
        model: Points of the shape.
        view: The object's points and the camera.
        start: Pose ``(7,)`` to begin at, robot base frame.
        free: Motions that are looked for, see `FREE`.
        steps: How many iterations at most.
        reach: Width of Cauchy's weight at the first step and at the last, metres.
        anchored: The start is what was believed before, and counts by `ANCHOR`: motions that hardly show, as
            of a mug whose handle is hidden, stay what they were instead of following the picture's errors.
    """
    pose = np.array(start, float)
    columns, points = list(free), view.points
    eye = view.camera.pose[:3]
    small = 0
    for k in range(steps):
        width = reach[0] * (reach[1] / reach[0]) ** min(1.0, 1.5 * k / max(steps - 1, 1))
        surface, normal = _facing(model, pose, eye)
        if len(surface) < 10:
            return pose
        nearest, distance2 = _closest(points, surface)
        a, n = surface[nearest] - pose[:3], normal[nearest]
        residual = np.sum(n * (points - surface[nearest]), axis=-1)
        weight = 1.0 / (1.0 + distance2 / (width * width))
        J = np.concatenate([n, np.cross(a, n)], axis=-1)[:, columns]
        H, pull, total = J.T @ (weight[:, None] * J), J.T @ (weight * residual), float(np.sum(weight))
        if view.fixtures is not None:
            J, share, depth = _too_deep(model, pose, view.fixtures)
            J = J[:, columns]
            H += FIRM * total * share * (J.T @ J)
            pull += FIRM * total * share * (J.T @ depth)
        # A motion that the shape does not show stays still.
        scale = np.array([1.0, 1.0, 1.0, LEVER, LEVER, LEVER])[columns] ** 2
        H[np.diag_indices_from(H)] += 1e-3 * total * scale
        if anchored:
            H[np.diag_indices_from(H)] += ANCHOR * total * scale
            pull -= ANCHOR * total * scale * _moved(start, pose)[columns]
        step = np.zeros(6)
        step[columns] = np.linalg.solve(H, pull)
        step[3:] *= min(1.0, 0.4 / max(float(np.linalg.norm(step[3:])), 1e-9))
        pose[:3] += step[:3]
        pose[3:] = poses.normalise(poses.quat_multiply(poses.from_rotation_vector(step[3:]), pose[3:]))
        small = small + 1 if np.linalg.norm(step[:3]) < 2e-5 and np.linalg.norm(step[3:]) < 2e-4 else 0
        if small >= 2 and k >= 0.7 * steps:
            break
    return pose


def judge_fit(model: ModelPoints, view: DepthView, pose: Array) -> Fit:
    """How well a pose explains the object's points, and what is seen where the object should be."""
    surface, normal = _facing(model, pose, view.camera.pose[:3])
    if len(surface) < 10:
        return Fit(pose, FAR, 1.0)
    nearest, distance2 = _closest(view.points, surface)
    across2 = np.sum(normal[nearest] * (view.points - surface[nearest]), axis=-1) ** 2
    # Beside a sample of the surface is still on the surface, as far as the next sample.
    along = np.maximum(np.sqrt(np.maximum(distance2 - across2, 0.0)) - model.spacing, 0.0)
    distance = float(np.mean(np.minimum(np.sqrt(across2 + along * along), FAR)))
    overlap = 0.0
    if view.fixtures is not None:
        depth, _ = beyond_faces(view.fixtures, poses.transform(pose, model.points), pose[:3])
        overlap = float(np.mean(np.clip(depth - NEARLY, 0.0, FAR)))
    return Fit(pose, distance, seen_through(model, view, pose), overlap)


def seen_through(model: ModelPoints, view: DepthView, pose: Array) -> float:
    """Share of the model's facing points in whose place something behind is seen, 0 to 1."""
    # Near the outline a small error of the camera shows what is behind: only what faces it well is judged.
    surface, _ = _facing(model, pose, view.camera.pose[:3], 0.35)
    return _missing(surface, view)


def _too_deep(model: ModelPoints, pose: Array, fixtures: Boxes) -> tuple[Array, float, Array]:
    """What reaches into fixtures.

    Returns:
        How motions ``(m, 6)`` move its points out, the share of the model that each of them is, and by how
        many metres ``(m,)`` they should be moved.
    """
    points = poses.transform(pose, model.points)
    depth, normal = beyond_faces(fixtures, points, pose[:3])
    deep = depth > NEARLY
    n = normal[deep]
    J = np.concatenate([n, np.cross(points[deep] - pose[:3], n)], axis=-1)
    return J, 1.0 / len(points), np.minimum(depth[deep] - NEARLY, 2 * FAR)


def _moved(start: Array, pose: Array) -> Array:
    """From one pose ``(7,)`` to another: translation and rotation vector ``(6,)``, base frame."""
    turn = poses.quat_multiply(pose[3:], poses.quat_conjugate(start[3:]))
    return np.concatenate([pose[:3] - start[:3], poses.rotation_vector(turn)])


def _missing(surface: Array, view: DepthView) -> float:
    """Share of the points ``(n, 3)`` of which neither the object nor anything before it is seen."""
    pixel, depth = project(view.camera, surface)
    column, row = np.floor(pixel).astype(int).T
    height, width = view.depth.shape
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height) & (depth > 0)
    column, row, depth = column[inside], row[inside], depth[inside]
    seen = view.depth[row, column]
    through = (seen > depth + SEE_THROUGH) & (seen > 0)
    if view.others is not None:
        through &= ~view.others[row, column]
    # What lies outside of the picture is neither seen nor missed.
    return float(np.count_nonzero(through)) / max(len(surface), 1)


def _facing(model: ModelPoints, pose: Array, eye: Array, least: float = 0.08) -> tuple[Array, Array]:
    """The model's points and normals, base frame, that face a camera at ``eye (3,)``.

    ``least`` is the cosine that the angle between normal and line of sight has at least.
    """
    matrix = poses.to_matrix(pose[3:])
    local_eye = matrix.T @ (eye - pose[:3])
    to_eye = local_eye - model.points
    cosine = np.sum(to_eye * model.normals, axis=-1) / np.sqrt(np.sum(to_eye * to_eye, axis=-1))
    facing = cosine > least
    return model.points[facing] @ matrix.T + pose[:3], model.normals[facing] @ matrix.T


def _closest(points: Array, surface: Array) -> tuple[Array, Array]:
    """The nearest of ``surface (m, 3)`` to each of ``points (n, 3)``: index and distance squared ``(n,)``."""
    middle = surface[0]
    p, s = points - middle, surface - middle
    # Not a matrix product: for three columns its threads cost more than they save.
    ahead, around = p.T.astype(np.float32, order="C"), s.T.astype(np.float32, order="C")
    score = np.einsum("ki,kj->ij", ahead, -2 * around)
    score += np.sum(around * around, axis=0)
    nearest = np.argmin(score, axis=-1)
    gap = p - s[nearest]
    return nearest, np.sum(gap * gap, axis=-1)
