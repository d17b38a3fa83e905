"""Nearest points on the surface of any triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.scene.meshes import TriangleMesh

FEW = 48
"""Triangles of a mesh up to which all are looked at, and of a larger one those about the nearest sample."""
SAMPLES = 2048
CELLS = 48
"""Along the longest side of a grid whose cells know their nearest sample."""
_BORDER = 0.5
"""By which the grid is larger than the mesh on each side, as a share of the longest side."""
_DENSE = 16
"""Times as many samples, by which triangles near a sample are found."""


class Samples(NamedTuple):
    """Points on a mesh ``(n, 3)``, the outward unit normals there ``(n, 3)``, and whose faces ``(n,)``."""

    points: Array
    normals: Array
    face: Array


def sampled(mesh: TriangleMesh, n: int, seed: int = 0) -> Samples:
    """Points spread over the surface by area, stratified along the list of triangles; the same for a seed.

    The square root makes them even within a triangle: Osada et al., "Shape distributions", ACM Transactions
    on Graphics 2002, section 4.2.
    """
    rng = np.random.default_rng(seed)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    twice = np.linalg.norm(normal, axis=1)
    share = np.cumsum(twice) / np.sum(twice)
    face = np.searchsorted(share, (np.arange(n) + rng.uniform(size=n)) / n).clip(max=len(twice) - 1)
    u, v = np.sqrt(rng.uniform(size=n))[:, None], rng.uniform(size=n)[:, None]
    points = (1 - u) * a[face] + u * (1 - v) * b[face] + u * v * c[face]
    return Samples(points, normal[face] / twice[face][:, None], face)


class _Table(NamedTuple):
    """How the triangles near a point are found.

    Attributes:
        low: Corner ``(3,)`` of a grid, metres.
        cell: Side of its cells, metres.
        shape: Numbers of cells along x, y and z.
        sample: For each cell, the number of the sample nearest to its middle ``(cells,)``.
        about: For each sample, the triangles about it ``(samples, few)``.
        corners: Of all triangles ``(m, 9)``, metres.
    """

    low: Array
    cell: float
    shape: tuple[int, int, int]
    sample: Array
    about: Array
    corners: Array


@dataclass(frozen=True, eq=False)
class MeshSurface:
    """The surface of a mesh, its hollows included.

    Exact for meshes of at most `FEW` triangles. For a larger one the cell of a grid that a point is in says
    which of `SAMPLES` points of the surface is near, and the nearest point of the `FEW` triangles about that
    one is taken: on things of 10 cm exact to a third of a millimetre near the surface, to 2 mm from
    as far as half its length, and beyond to 15 % of the distance.
    """

    mesh: TriangleMesh

    @cached_property
    def _table(self) -> _Table:
        corners = self.mesh.vertices[self.mesh.faces]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        corners = corners[area > 1e-14]
        flat = corners.reshape(-1, 9)
        if len(corners) <= FEW:
            return _Table(
                np.zeros(3), 1.0, (1, 1, 1), np.zeros(1, np.int64), np.arange(len(corners))[None], flat
            )
        from scipy.spatial import cKDTree

        mesh = TriangleMesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        dense = sampled(mesh, _DENSE * SAMPLES)
        places = np.concatenate([dense.points, corners.mean(axis=1)])
        owner = np.concatenate([dense.face, np.arange(len(corners))])
        coarse = dense.points[::_DENSE]
        _, near = cKDTree(places).query(coarse, k=min(12 * FEW, len(places)))
        about = np.array([_first(owner[row]) for row in near])
        low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
        border = _BORDER * float(np.max(high - low))
        cell = float(np.max(high - low) + 2 * border) / CELLS
        x, y, z = (int(n) for n in np.ceil((high - low + 2 * border) / cell))
        grid = np.stack(np.meshgrid(*(np.arange(n) for n in (x, y, z)), indexing="ij"), axis=-1)
        _, sample = cKDTree(coarse).query((low - border) + (grid.reshape(-1, 3) + 0.5) * cell)
        return _Table(low - border, cell, (x, y, z), sample, about, flat)

    def nearest(self, point: Array) -> Array:
        """See `bt_tasksim.scene.surfaces.OuterSurface.nearest`."""
        xp = array_namespace(point)
        table = self._table
        wanted = xp.reshape(point, (-1, 3))
        place = (wanted - constant(table.low, wanted)) / table.cell
        last = constant([float(n - 1) for n in table.shape], wanted)
        place = xp.floor(xp.minimum(xp.maximum(place, xp.zeros_like(place)), last + xp.zeros_like(place)))
        _, y, z = table.shape
        number = xp.astype((place[:, 0] * y + place[:, 1]) * z + place[:, 2], xp.int64)
        sample = xp.take(xp.asarray(table.sample, device=number.device), number, axis=0)
        chosen = xp.take(xp.asarray(table.about, device=number.device), sample, axis=0)
        k = chosen.shape[1]
        found = xp.take(constant(table.corners, wanted), xp.reshape(chosen, (-1,)), axis=0)
        found = xp.reshape(found, (wanted.shape[0], k, 3, 3))
        near = nearest_on_triangles(wanted[:, None, :], found)
        gap = near - wanted[:, None, :]
        best = xp.argmin(_dot(gap, gap), axis=-1)
        start = xp.arange(wanted.shape[0], dtype=best.dtype, device=best.device) * k
        return xp.reshape(xp.take(xp.reshape(near, (-1, 3)), start + best, axis=0), point.shape)


def nearest_on_triangles(point: Array, corners: Array) -> Array:
    """The nearest points ``(n, k, 3)`` of triangles ``(n, k, 3, 3)`` to points ``(n, 1, 3)``.

    The foot of the perpendicular where it lies inside, by its barycentric coordinates, else the nearest point
    of the three sides; Ericson, "Real-Time Collision Detection", 2005, section 5.1.5.
    """
    xp = array_namespace(point)
    a, b, c = (corners[..., i, :] for i in range(3))
    ab, ac, ap = b - a, c - a, point - a
    d00, d01, d11 = _dot(ab, ab), _dot(ab, ac), _dot(ac, ac)
    d20, d21 = _dot(ap, ab), _dot(ap, ac)
    det = d00 * d11 - d01 * d01
    det = xp.where(det > 0.0, det, xp.ones_like(det))
    v, w = (d11 * d20 - d01 * d21) / det, (d00 * d21 - d01 * d20) / det
    inside = (v >= 0.0) & (w >= 0.0) & (v + w <= 1.0)
    best = a + v[..., None] * ab + w[..., None] * ac
    least = xp.where(inside, -xp.ones_like(v), xp.full_like(v, xp.inf))
    for start, end in ((a, b), (b, c), (c, a)):
        side = end - start
        t = xp.clip(_dot(point - start, side) / _dot(side, side), 0.0, 1.0)
        foot = start + t[..., None] * side
        gap = point - foot
        far = _dot(gap, gap)
        best = xp.where((far < least)[..., None], foot, best)
        least = xp.minimum(far, least)
    return best


def _dot(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def _first(owners: Array) -> Array:
    """The first `FEW` different ones ``(few,)``, the last one again where there are fewer."""
    _, at = np.unique(owners, return_index=True)
    kept = owners[np.sort(at)[:FEW]]
    return np.concatenate([kept, np.full(FEW - len(kept), kept[-1])])
