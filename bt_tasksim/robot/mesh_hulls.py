"""Convex hulls of the mesh files that a robot's URDF names."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from bt_tasksim.core.errors import InputError, NoVolumeError
from bt_tasksim.core.poses import Array


@lru_cache(maxsize=256)
def mesh_hull(path: str, scale: tuple[float, float, float]) -> Array:
    """Corners ``(n, 3)`` of the convex hull of a mesh file, scaled; metres.

    Raises:
        NoVolumeError: Its corners lie in one plane.
        InputError: The file cannot be read.
    """
    from bt_tasksim.core.convex_hulls import check_volume
    from bt_tasksim.core.narrow_phase import coal

    try:
        mesh = coal.MeshLoader().load(path, np.array(scale))
        check_volume(np.array(mesh.vertices(), float).reshape(-1, 3))
        mesh.buildConvexHull(True, "Qt")
        corners = np.array(mesh.convex.points())
    except NoVolumeError as error:
        raise NoVolumeError(f"mesh '{path}' is no body: {error}") from error
    except (RuntimeError, ValueError) as error:
        raise InputError(f"mesh '{path}' cannot be read: {' '.join(str(error).split())}") from error
    corners.setflags(write=False)
    return corners
