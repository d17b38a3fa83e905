"""Objects from mesh files."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.files import file_version
from bt_tasksim.core.registry import register
from bt_tasksim.scene.antipodal import antipodal_grips, ends_at
from bt_tasksim.scene.geometry import Shape, ShapeSize, Size
from bt_tasksim.scene.grips import Grips
from bt_tasksim.scene.mesh_file import mesh_extent, mesh_shape, mesh_solid
from bt_tasksim.scene.mesh_symmetry import symmetry_about_z
from bt_tasksim.scene.meshes import TriangleMesh, mass_properties
from bt_tasksim.scene.shape_kind import GraspAxis, ShapeKind, level_grasp_axes

_NEAR = 1e-3
"""Metres."""
_WIDEST = 0.078
"""Metres: wider than that is no axis of a grasp, see `ObjectModel.grasp_axes`."""


@register("shape", "mesh")
class MeshKind(ShapeKind):
    """A closed mesh in a file; it has the size of its file unless another one is given."""

    size_range = ((0.05, 0.05, 0.05), (0.05, 0.05, 0.05))
    symmetry = 1
    from_file = True

    def check(self, size: ShapeSize) -> None:
        """See `ShapeKind.check`."""
        super().check(size)
        _given(size.mesh)

    def sizes(self, mesh: str | None = None) -> tuple[Size, Size]:
        """See `ShapeKind.sizes`: those of the file.

        Raises:
            InputError: There is no file, or it cannot be read.
        """
        extent = mesh_extent(_given(mesh))
        return extent, extent

    def shape(self, size: ShapeSize) -> Shape:
        """See `ShapeKind.shape`."""
        return mesh_shape(_given(size.mesh), size.size)

    def symmetry_of(self, size: ShapeSize) -> int:
        """See `ShapeKind.symmetry_of`: as the mesh looks."""
        path = _given(size.mesh)
        return _symmetry(path, size.size, file_version(path))

    def grasp_axes(self, size: ShapeSize) -> tuple[GraspAxis, ...]:
        """See `ShapeKind.grasp_axes`.

        Those of its bounding box along which it has a surface in the middle of both sides, else those of its
        best grips: fingers that close about the middle of an L meet nothing.
        """
        path = _given(size.mesh)
        return _axes(path, size.size, file_version(path))

    def grips(self, size: ShapeSize) -> Grips:
        """See `ShapeKind.grips`: opposite points of its surface."""
        path = _given(size.mesh)
        return _grips(path, size.size, file_version(path))


@lru_cache(maxsize=256)
def _symmetry(path: str, size: Size, version: tuple[int, ...]) -> int:
    return symmetry_about_z(mesh_solid(path, size))


@lru_cache(maxsize=256)
def _grips(path: str, size: Size, version: tuple[int, ...]) -> Grips:
    mesh = mesh_solid(path, size)
    return antipodal_grips(mesh, mass_properties(mesh).pose[:3])


@lru_cache(maxsize=256)
def _axes(path: str, size: Size, version: tuple[int, ...]) -> tuple[GraspAxis, ...]:
    mesh, box = mesh_solid(path, size), level_grasp_axes(ShapeSize(size, mesh=path))
    met = tuple(axis for axis in box if _met(mesh, axis))
    return met or _grips(path, size, version).axes(_WIDEST) or box


def _met(mesh: TriangleMesh, axis: GraspAxis) -> bool:
    """Whether fingers that close about the origin meet the surface where the bounding box ends."""
    ends = ends_at(mesh, np.zeros(3), np.array(axis[0]))
    return ends is not None and abs(ends[0] + axis[1] / 2) < _NEAR and abs(ends[1] - axis[1] / 2) < _NEAR


def _given(mesh: str | None) -> str:
    if mesh is None:
        raise InputError("an object of kind 'mesh' needs the path of a mesh file")
    return mesh
