"""How often a mesh looks the same in one turn about the vertical."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.mesh_surface import nearest_on_triangles, sampled
from bt_tasksim.scene.meshes import TriangleMesh, mass_properties
from bt_tasksim.scene.symmetry import symmetry_tolerance

ASIDE = 0.005
"""Metres that the axis of a symmetry may be beside the frame's origin: a star's bounding box has another
middle than the star, and goals allow for more than twice that."""
MOST = 12
"""Largest order looked for, below a body of revolution."""
_ODD = tuple(2 * math.pi * turn for turn in (0.0731, 0.1618, 0.2929, 0.4142))
"""Angles in radians of no symmetry of a low order: what looks the same turned by all of them is round."""
_POINTS = 600
"""Vertices looked at first. What looks the same by these is looked at by all: a spout may have few."""
_SAMPLES, _ABOUT = 8192, 16
"""Samples of a surface, and how many of them about a point say which triangles may be the nearest."""


def symmetry_about_z(mesh: TriangleMesh) -> int:
    """Order of a mesh's symmetry about the vertical through its centre of mass, 0 for a body of revolution.

    1 where there is none, or where that vertical is farther than `ASIDE` from the frame's.
    """
    centre = mass_properties(mesh).pose[:3] * np.array([1.0, 1.0, 0.0])
    if float(np.linalg.norm(centre)) > ASIDE:
        return 1
    points = mesh.vertices - centre
    few = points[:: -(-len(points) // _POINTS)]
    alike = symmetry_tolerance(np.ptp(mesh.vertices, axis=0))

    to_surface = _distances(mesh)

    def on_it(some: Array, angle: float) -> bool:
        return float(np.max(to_surface(poses.rotate(poses.yaw(angle)[None], some) + centre))) <= alike

    def same(angle: float) -> bool:
        return on_it(few, angle) and (len(few) == len(points) or on_it(points, angle))

    if all(same(angle) for angle in _ODD):
        return 0
    return next((n for n in range(MOST, 1, -1) if same(2 * math.pi / n)), 1)


def _distances(mesh: TriangleMesh) -> Callable[[Array], Array]:
    """Distances ``(n,)`` in metres of points ``(n, 3)`` to a mesh, from the triangles near them."""
    from scipy.spatial import cKDTree

    corners, samples = mesh.vertices[mesh.faces], sampled(mesh, _SAMPLES)
    tree = cKDTree(np.concatenate([samples.points, corners.mean(axis=1)]))
    owner = np.concatenate([samples.face, np.arange(len(corners))])

    def distances(points: Array) -> Array:
        _, near = tree.query(points, k=_ABOUT)
        found = nearest_on_triangles(points[:, None], corners[owner[near]]) - points[:, None]
        least: Array = np.min(np.linalg.norm(found, axis=-1), axis=-1)
        return least

    return distances
