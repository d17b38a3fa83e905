"""Objects from a user's own mesh files: read, checked, put right, and made into convex pieces."""

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
from bt_tasksim.core.own_files import not_there
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.convex_parts import convex_parts
from bt_tasksim.scene.geometry import ConvexPiece, Piece, Shape
from bt_tasksim.scene.glb_header import check_glb
from bt_tasksim.scene.mesh_bodies import separate, solids_and_cavities, united
from bt_tasksim.scene.mesh_surface import MeshSurface
from bt_tasksim.scene.meshes import TriangleMesh, cube_sphere, mass_properties, volume_of

SMALLEST = 0.005
LARGEST = 1.0
"""Metres: the longest side of an object that an arm can handle lies between these."""

FORMATS = ("obj", "stl", "ply", "off", "glb")
"""Forms of mesh files, each in one file."""
MOST_BYTES = 64 << 20
MOST_TRIANGLES = 500_000
"""Triangles of a mesh: grips and symmetries are looked for on all of them."""
MOST_BODIES = 256
"""Separate bodies of a mesh: physics looks at each one's contacts."""
FARTHEST = 1e6
"""Largest coordinate in a mesh's own units."""
_MOST_VERTICES = 64
_FILLED = 1.2
_NO_VOLUME = 1e-9
"""Share of the bounding box below which a body is none."""


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

    Each body in the file collides as its convex parts (`bt_tasksim.scene.convex_parts`); what is weighed,
    seen and touched is the mesh itself.

    Raises:
        InputError: The file is not a closed mesh, or the size is not one that an arm can handle.
        MachineError: A package that reads or decomposes meshes is not installed.
    """
    visual = mesh_solid(path, size)
    mass = mass_properties(visual)
    whole, bodies = _read(path, file_version(path))
    scale, middle = _fitting(whole, size)
    pieces: list[Piece] = []
    filled = 0.0
    for body in bodies:
        for part in convex_parts(body):
            vertices, volume = _hull((part - middle) * scale)
            pieces.append(ConvexPiece(vertices))
            filled += volume
    if len(bodies) == 1 and filled > _FILLED * mass.volume:
        warnings.warn(
            f"mesh '{path}' has thin walls, which its {len(pieces)} convex parts make thicker "
            f"({filled / mass.volume - 1:.0%} more volume); to choose the parts, save "
            f"them as several separate closed convex bodies in one file",
            BtTasksimWarning,
            stacklevel=2,
        )
    return Shape(size, tuple(pieces), lambda: visual, lambda: mass, MeshSurface(visual))


def mesh_solid(path: str, size: tuple[float, float, float]) -> TriangleMesh:
    """The surface of all that is in a mesh file, scaled to a bounding box of ``size (3,)`` metres, centred.

    Raises:
        InputError: As `mesh_shape`.
        MachineError: The package that reads meshes is not installed.
    """
    check_size(f"mesh '{path}'", size)
    whole, _ = _read(path, file_version(path))
    scale, middle = _fitting(whole, size)
    return TriangleMesh((whole.vertices - middle) * scale, whole.faces)


def _fitting(whole: TriangleMesh, size: tuple[float, float, float]) -> tuple[Array, Array]:
    """Factors ``(3,)`` that give it a size, and its middle ``(3,)``."""
    low, high = np.min(whole.vertices, axis=0), np.max(whole.vertices, axis=0)
    return np.array(size) / (high - low), (low + high) / 2


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
    """The surface of all that is in this version of a file, and its bodies."""
    if not Path(path).is_file():
        raise InputError(not_there("mesh file", path))
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
    # From memory: a mesh file may name other files, of materials and pictures, which are not opened.
    content = Path(path).read_bytes()
    try:
        if form == "glb":
            check_glb(content, MOST_TRIANGLES)
    except InputError as error:
        raise InputError(f"mesh '{path}' {error}") from None
    try:
        with np.errstate(all="ignore"):  # numbers without bounds, which are looked at below
            loaded = trimesh.load(io.BytesIO(content), file_type=form, force="mesh", skip_materials=True)
            loaded.merge_vertices()
    except Exception as error:  # readers of a dozen formats raise whatever they please
        raise InputError(f"mesh '{path}' cannot be read: {type(error).__name__}: {error}") from error
    if not isinstance(loaded, trimesh.Trimesh) or len(loaded.faces) < 4:
        raise InputError(f"mesh '{path}' has no solid in it: fewer than four triangles")
    if len(loaded.faces) > MOST_TRIANGLES:
        raise InputError(
            f"mesh '{path}' has {len(loaded.faces)} triangles, more than {MOST_TRIANGLES}: save it "
            f"with fewer, such as with Blender's modifier Decimate"
        )
    if not np.all(np.isfinite(loaded.vertices)):
        raise InputError(f"mesh '{path}' has coordinates that are not finite numbers")
    if np.abs(loaded.vertices).max() > FARTHEST:
        raise InputError(
            f"mesh '{path}' has coordinates beyond {FARTHEST:g}: save it in metres or millimetres"
        )
    try:
        solids, cavities = solids_and_cavities(_bodies(loaded))
        whole = united(solids, cavities)
    except InputError as error:
        raise InputError(f"mesh '{path}' {error}") from None
    return whole, tuple(solids)


def _bodies(mesh: Any) -> list[TriangleMesh]:
    """Separate bodies of what a reader has given; its errors say only what is wrong."""
    vertices, faces = np.array(mesh.vertices, float), np.array(mesh.faces, np.int64)
    if np.min(np.ptp(vertices, axis=0)) <= 0:
        raise InputError("is flat: it encloses no volume")
    different = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    bodies = separate(vertices, faces[different])
    if len(bodies) > MOST_BODIES:
        raise InputError(f"has {len(bodies)} separate bodies, more than {MOST_BODIES}: save fewer")
    smallest = _NO_VOLUME * float(np.prod(np.ptp(vertices, axis=0)))
    bodies = [body for body in bodies if abs(volume_of(body)) > smallest]
    if not bodies:
        raise InputError("is flat: it encloses no volume")
    return bodies


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
