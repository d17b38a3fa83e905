"""Convex hulls of the mesh files that a robot's URDF names."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array


@lru_cache(maxsize=256)
def mesh_hull(path: str, scale: tuple[float, float, float]) -> Array:
    """Corners ``(n, 3)`` of the convex hull of a mesh file, scaled; metres.

    Raises:
        InputError: The file cannot be read.
    """
    from bt_tasksim.core.narrow_phase import coal

    try:
        mesh = coal.MeshLoader().load(path, np.array(scale))
        mesh.buildConvexHull(True, "Qt")
        corners = np.array(mesh.convex.points())
    except (RuntimeError, ValueError) as error:
        raise InputError(f"mesh '{path}' cannot be read: {' '.join(str(error).split())}") from error
    corners.setflags(write=False)
    return corners
