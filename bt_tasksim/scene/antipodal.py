"""Where two fingers may hold any solid: opposite points of its surface, found by rays.

Points are drawn on the surface, and a line is followed from each along its inward normal; wherever it leaves
the solid at an angle within the friction cone, the two points can be held between two fingers (Nguyen,
"Constructing force-closure grasps", IJRR 1988; drawn as by Mahler et al., "Dex-Net 2.0", RSS 2017, and ten
Pas et al., "Grasp pose detection in point clouds", IJRR 2017). What is hollow is so held by its wall, or from
outside to outside.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.scene.grips import Grips, firm_about
from bt_tasksim.scene.mesh_surface import Samples, sampled
from bt_tasksim.scene.meshes import TriangleMesh

WIDEST = 0.12
"""Metres between two contacts; narrower hands leave the wider ones out."""
FRICTION = 0.4
"""Coefficient in whose cone both normals must lie."""
MOST = 64
PAD = 0.0075
"""Metres: radius of the patch of a contact that a fingertip covers."""
FREE = 0.006
"""Metres beyond both contacts that must be free, for a finger to be there."""
_LINES = 600
_WORK = 12_000_000
"""Lines times triangles: of very fine meshes fewer lines are followed."""
_CHUNK = 400_000
"""Pairs of a line and a triangle that are looked at together."""
_SAME = 0.002
"""Metres: nearer ones are the same grip."""
_PATCH_POINTS = 6000
_FLAT = 0.001
"""Metres by which a patch's points may lie above or below its plane."""
_TURN = 0.03
"""Metres apart that two grips count at the same point, closing across each other."""


def antipodal_grips(mesh: TriangleMesh, centre: Array) -> Grips:
    """At most `MOST` grips of a solid that differ in place and direction, the firmest first.

    Args:
        mesh: Its closed surface, metres.
        centre: Centre of mass ``(3,)``.

    Returns:
        The grips, possibly none. A grip's firmness is the product of how well its closing axis agrees with
        both normals, of the share of a fingertip that meets the surface, and of how near it is to the centre.
    """
    starts, ways = _lines(mesh, centre)
    first, last, n_first, n_last = _held(mesh, starts, ways)
    if not len(first):
        return Grips.of(np.zeros((0, 3)), np.zeros((0, 3)), [])
    patch = sampled(mesh, _PATCH_POINTS, seed=1)
    density = _area(mesh) / _PATCH_POINTS
    flat = np.minimum(_patch(first, n_first, patch, density), _patch(last, n_last, patch, density))
    across = last - first
    width = np.linalg.norm(across, axis=1)
    closing = across / width[:, None]
    worst = np.minimum(-np.sum(closing * n_first, axis=1), np.sum(closing * n_last, axis=1))
    aligned = 1.0 - np.arccos(np.clip(worst, -1.0, 1.0)) / math.atan(FRICTION)
    middle = (first + last) / 2
    firm = (0.4 + 0.6 * np.clip(aligned, 0.0, 1.0)) * (0.1 + 0.9 * flat) * firm_about(middle, centre)
    keep = _spread(middle, closing, firm)
    return Grips.of(middle[keep], closing[keep], width[keep], firmness=firm[keep])


def width_at(mesh: TriangleMesh, point: Array, closing: Array) -> float | None:
    """Metres between two fingers that close evenly about a point, see `ends_at`; None: no surface."""
    ends = ends_at(mesh, point, closing)
    return None if ends is None else 2 * max(-ends[0], ends[1])


def ends_at(mesh: TriangleMesh, point: Array, closing: Array) -> tuple[float, float] | None:
    """Where fingers that close about a point ``(3,)`` along a direction ``(3,)`` meet a solid, metres.

    From within the solid that is the nearest surface on either side, and from a hollow the farthest. None
    where there is none on one of the sides.
    """
    corners = mesh.vertices[mesh.faces]
    way = closing / np.linalg.norm(closing) + 1e-9 * np.array([0.31, 0.57, 0.83])
    ((at, face),) = crossings(corners, np.asarray(point, float)[None], way[None])
    if not (np.any(at < 0) and np.any(at > 0)):
        return None
    after = int(np.searchsorted(at, 0.0))
    a, b, c = corners[face[after]]
    within = float(np.cross(b - a, c - a) @ way) > 0
    low, high = (at[after - 1], at[after]) if within else (at[0], at[-1])
    return float(low), float(high)


def _lines(mesh: TriangleMesh, centre: Array) -> tuple[Array, Array]:
    """Points and directions ``(n, 3)`` of lines: inwards from samples, and through the middle."""
    n = int(np.clip(_WORK / len(mesh.faces), 60, _LINES))
    samples = sampled(mesh, n)
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    axes = np.concatenate([np.eye(3), np.eye(3)])
    through = np.repeat([middle, centre], 3, axis=0) + 1e-7 * np.array([0.31, 0.57, 0.83])
    reach = float(np.max(np.ptp(mesh.vertices, axis=0)))
    starts = np.concatenate([through - 2 * reach * axes, samples.points + 1e-9 * samples.normals])
    return starts, np.concatenate([axes, -samples.normals])


def _held(mesh: TriangleMesh, starts: Array, ways: Array) -> tuple[Array, Array, Array, Array]:
    """Pairs of points ``(g, 3)`` that can be held along lines, and their outward normals."""
    corners = mesh.vertices[mesh.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    corners, normal = corners[length > 1e-14], (cross / np.maximum(length, 1e-14)[:, None])[length > 1e-14]
    within = math.cos(math.atan(FRICTION))
    found: list[tuple[Array, Array, Array, Array]] = []
    for start, way, (at, face) in zip(starts, ways, crossings(corners, starts, ways), strict=True):
        slope = normal[face] @ way
        enters, leaves = np.flatnonzero(slope < -within), np.flatnonzero(slope > within)
        for i in enters:
            for j in leaves:
                span = at[j] - at[i]
                if not 1e-4 < span <= WIDEST:
                    continue
                before = (at < at[i] - 1e-6) & (at > at[i] - FREE)
                beyond = (at > at[j] + 1e-6) & (at < at[j] + FREE)
                if not (np.any(before) or np.any(beyond)):
                    found.append((start + at[i] * way, start + at[j] * way, normal[face[i]], normal[face[j]]))
    if not found:
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3))
    first, last, n_first, n_last = (np.array(column) for column in zip(*found, strict=True))
    return first, last, n_first, n_last


def crossings(corners: Array, starts: Array, ways: Array) -> Iterator[tuple[Array, Array]]:
    """Where each line meets triangles ``(m, 3, 3)``: distances along it, in order, and which ones.

    Moeller and Trumbore, "Fast, minimum storage ray-triangle intersection", JGT 1997.
    """
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    size = max(1, _CHUNK // len(corners))
    for begin in range(0, len(starts), size):
        start, way = starts[begin : begin + size, None], ways[begin : begin + size, None]
        p = np.cross(way, ac[None])
        det = np.sum(ab * p, axis=-1)
        inverse = 1.0 / np.where(np.abs(det) > 1e-18, det, np.inf)
        s = start - a
        u = np.sum(s * p, axis=-1) * inverse
        q = np.cross(s, ab[None])
        v = np.sum(way * q, axis=-1) * inverse
        t = np.sum(ac * q, axis=-1) * inverse
        hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (inverse != 0.0)
        for row in range(len(hit)):
            face = np.flatnonzero(hit[row])
            order = np.argsort(t[row, face], kind="stable")
            yield t[row, face[order]], face[order]


def _patch(points: Array, normals: Array, patch: Samples, density: float) -> Array:
    """Shares ``(g,)`` of a fingertip's pad about each point that meet the surface, by samples of it."""
    samples, size = patch.points, max(1, _CHUNK // len(patch.points))
    square, met = np.sum(samples * samples, axis=1), np.empty(len(points))
    for begin in range(0, len(points), size):
        point, normal = points[begin : begin + size], normals[begin : begin + size]
        height = normal @ samples.T - np.sum(normal * point, axis=1)[:, None]
        far = square - 2.0 * (point @ samples.T) + np.sum(point * point, axis=1)[:, None]
        there = far - height * height <= PAD * PAD
        there &= (np.abs(height) < _FLAT) & (normal @ patch.normals.T > 0.7)
        met[begin : begin + size] = np.count_nonzero(there, axis=1)
    return np.minimum(met * density / (math.pi * PAD * PAD), 1.0)


def _spread(points: Array, closing: Array, firm: Array) -> Array:
    """Numbers of at most `MOST` of them, firm and far from each other, the firmest first.

    Farthest point sampling (Gonzalez, "Clustering to minimize the maximum intercluster distance", 1985),
    weighted by firmness.
    """
    taken = [int(np.argmax(firm))]
    apart = np.full(len(firm), np.inf)
    while len(taken) < min(MOST, len(firm)):
        last = taken[-1]
        turn = 1.0 - np.abs(closing @ closing[last])
        apart = np.minimum(apart, np.linalg.norm(points - points[last], axis=1) + _TURN * turn)
        score = apart * (0.2 + firm)
        best = int(np.argmax(score))
        if apart[best] < _SAME:
            break
        taken.append(best)
    chosen = np.array(taken)
    return chosen[np.argsort(-firm[chosen], kind="stable")]


def _area(mesh: TriangleMesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.sum(np.linalg.norm(np.cross(b - a, c - a), axis=1))) / 2
