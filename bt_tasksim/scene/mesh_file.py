"""Objects from a user's own mesh files: read, checked, and made into convex pieces."""

from __future__ import annotations

import io
import os
import warnings
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from bt_tasksim.core.errors import BtTasksimWarning, InputError, MachineError
from bt_tasksim.core.files import file_version
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.geometry import ConvexPiece, Piece, Shape
from bt_tasksim.scene.meshes import TriangleMesh, cube_sphere, mass_properties
from bt_tasksim.scene.surfaces import Polygon, PrismSurface

SMALLEST = 0.005
LARGEST = 1.0
"""Metres: the longest side of an object that an arm can handle lies between these."""

FORMATS = ("obj", "stl", "ply", "off", "glb")
"""Forms of mesh files, each in one file."""
MOST_BYTES = 64 << 20
MOST_BODIES = 256
"""Separate bodies of a mesh: physics looks at each one's contacts."""
FARTHEST = 1e6
"""Largest coordinate in a mesh's own units."""
_MOST_VERTICES = 64
_HOLLOW = 1.2


def mesh_extent(path: str) -> tuple[float, float, float]:
    """Full size ``(3,)`` of a mesh file's bounding box, in the file's units.

    Raises:
        InputError: The file is not a closed mesh.
        MachineError: The package that reads meshes is not installed.
    """
    x, y, z = np.ptp(_read(path, file_version(path))[0].vertices, axis=0).tolist()
    return float(x), float(y), float(z)


def mesh_shape(path: str, size: tuple[float, float, float]) -> Shape:
    """The geometry of a mesh file, scaled to a bounding box of ``size (3,)`` metres.

    Each separate body in the file collides as its own convex hull.

    Raises:
        InputError: The file is not a closed mesh, or the size is not one that an arm can handle.
        MachineError: The package that reads meshes is not installed.
    """
    check_size(f"mesh '{path}'", size)
    whole, bodies = _read(path, file_version(path))
    low, high = np.min(whole.vertices, axis=0), np.max(whole.vertices, axis=0)
    scale, middle = np.array(size) / (high - low), (low + high) / 2
    visual = TriangleMesh((whole.vertices - middle) * scale, whole.faces)
    mass = mass_properties(visual)
    pieces: list[Piece] = []
    hulls = 0.0
    for body in bodies:
        vertices, volume = _hull((body.vertices - middle) * scale)
        pieces.append(ConvexPiece(vertices))
        hulls += volume
    if hulls > _HOLLOW * mass.volume:
        warnings.warn(
            f"mesh '{path}' has hollows, which its convex hull fills ({hulls / mass.volume - 1:.0%} more "
            f"volume): to keep them, save it as several separate closed convex bodies in one file",
            BtTasksimWarning,
            stacklevel=2,
        )
    return Shape(size, tuple(pieces), lambda: visual, lambda: mass, _box_surface(size))


def check_size(what: str, size: tuple[float, float, float]) -> None:
    """Refuse an object that cannot be meant in metres.

    Args:
        what: Its name, for the error's sentence.
        size: Full size ``(3,)``, metres.

    Raises:
        InputError: It is too large or too small; says which unit it may have been.
    """
    longest = max(size)
    if SMALLEST <= longest <= LARGEST:
        return
    hint = "set 'scale' so that it comes out in metres"
    if LARGEST < longest <= 1000 * LARGEST and longest / 1000 >= SMALLEST:
        hint = "it looks like millimetres: set scale: 0.001"
    raise InputError(
        f"{what} is {longest:.4g} m long, and an object should be between {SMALLEST:g} m and "
        f"{LARGEST:g} m: {hint}"
    )


@lru_cache(maxsize=256)
def _read(path: str, version: tuple[int, ...]) -> tuple[TriangleMesh, tuple[TriangleMesh, ...]]:
    """The mesh in this version of a file, and its separate bodies."""
    if not Path(path).is_file():
        raise InputError(f"no mesh file '{path}'")
    try:
        import trimesh
    except ImportError:
        raise MachineError(
            "mesh files need the package trimesh: install bt-tasksim with its extra 'sim'"
        ) from None
    form = Path(path).suffix[1:].lower()
    if form not in FORMATS:
        raise InputError(
            f"mesh '{path}' cannot be read: its name should end with one of {', '.join(FORMATS)}"
        )
    if os.stat(path).st_size > MOST_BYTES:
        raise InputError(f"mesh '{path}' is larger than {MOST_BYTES >> 20} MiB: save it with fewer triangles")
    try:
        # From memory: a mesh file may name other files, of materials and pictures, which are not opened.
        content = io.BytesIO(Path(path).read_bytes())
        with np.errstate(all="ignore"):  # numbers without bounds, which are looked at below
            loaded = trimesh.load(content, file_type=form, force="mesh", skip_materials=True)
            loaded.merge_vertices()
    except Exception as error:  # readers of a dozen formats raise whatever they please
        raise InputError(f"mesh '{path}' cannot be read: {type(error).__name__}: {error}") from error
    if not isinstance(loaded, trimesh.Trimesh) or len(loaded.faces) < 4:
        raise InputError(f"mesh '{path}' has no solid in it: fewer than four triangles")
    if not np.all(np.isfinite(loaded.vertices)):
        raise InputError(f"mesh '{path}' has coordinates that are not finite numbers")
    if np.abs(loaded.vertices).max() > FARTHEST:
        raise InputError(
            f"mesh '{path}' has coordinates beyond {FARTHEST:g}: save it in metres or millimetres"
        )
    if not loaded.is_watertight:
        raise InputError(
            f"mesh '{path}' is not watertight: {_holes(loaded)} of its edges do not join two triangles"
        )
    if not loaded.is_winding_consistent:
        raise InputError(f"mesh '{path}' has triangles that face different ways: recompute its normals")
    if np.min(np.ptp(loaded.vertices, axis=0)) <= 0 or abs(loaded.volume) <= 0:
        raise InputError(f"mesh '{path}' is flat: it encloses no volume")
    if loaded.volume < 0:
        loaded.invert()
    if loaded.body_count > MOST_BODIES:
        raise InputError(
            f"mesh '{path}' has {loaded.body_count} separate bodies, more than {MOST_BODIES}: save fewer"
        )
    bodies = loaded.split(only_watertight=True)
    return _plain(loaded), tuple(_plain(body) for body in bodies)


def _holes(mesh: Any) -> int:
    _, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    return int(np.sum(count != 2))


def _plain(mesh: Any) -> TriangleMesh:
    return TriangleMesh(np.array(mesh.vertices, float), np.array(mesh.faces, np.int64))


def _hull(points: Array) -> tuple[Array, float]:
    """Corners ``(n, 3)`` of the convex hull, at most 64 of them, and its volume in m^3."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    corners = points[hull.vertices]
    if len(corners) > _MOST_VERTICES:
        span = np.ptp(corners, axis=0)
        directions = np.concatenate([cube_sphere(3).vertices, np.eye(3), -np.eye(3)]) / span
        corners = corners[np.unique(np.argmax(directions @ corners.T, axis=1))]
    corners.setflags(write=False)
    return corners, float(hull.volume)


def _box_surface(size: tuple[float, float, float]) -> PrismSurface:
    x, y = size[0] / 2, size[1] / 2
    return PrismSurface(Polygon(((x, y), (-x, y), (-x, -y), (x, -y))), size[2] / 2)
